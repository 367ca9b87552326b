"""`python -m ldls` is `ldls`."""

from ldls.cli import app

if __name__ == "__main__":
    app(prog_name="ldls")
