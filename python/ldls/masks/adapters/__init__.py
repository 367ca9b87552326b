"""What other programs hold in memory, as mask records: one module a program, none of which it imports."""
