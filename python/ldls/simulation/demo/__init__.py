"""The small street of `ldls demo`: numpy alone, no ray-casting library."""
