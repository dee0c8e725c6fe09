"""Run the README's two commands and put what they print into the blocks below them.

python tools/readme_output.py            # both
python tools/readme_output.py --only 1   # the first

The commands are run as they stand there, from the checkout, so they make or update `.venv`.  Of the tests only the last
line is kept.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
from pathlib import Path

README = Path(__file__).resolve().parent.parent / "README.md"
COMMAND_AND_OUTPUT = re.compile(r"(^```sh\n(.*?)\n```\n(?:[^`]*?))^```\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def output(command: str) -> str:
    """What a command prints.

    Raises:
        CalledProcessError: it ends with another code than 0.
    """
    variables = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "VIRTUAL_ENV", "COLUMNS")}
    done = subprocess.run(
        ["bash", "-c", command], cwd=README.parent, env=variables, check=True, stdout=subprocess.PIPE, text=True
    )
    return "\n".join(line.rstrip() for line in done.stdout.splitlines())


def main() -> None:
    """Run and paste."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", type=int, choices=(1, 2), help="run only this command")
    wanted = parser.parse_args().only
    count = 0

    def paste(found: re.Match[str]) -> str:
        nonlocal count
        count += 1
        if count > 2 or wanted not in (None, count):
            return found[0]
        text = output(found[2])
        if count == 2:
            text = text.splitlines()[-1].strip("= ")
        return f"{found[1]}```\n{text}\n```"

    README.write_text(COMMAND_AND_OUTPUT.sub(paste, README.read_text()))


if __name__ == "__main__":
    main()
