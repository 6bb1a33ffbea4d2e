"""The diagnosing process: python -m radiation_ss.blind.worker FOLDER TASK... [--attached]."""

import argparse
import os
import threading
from pathlib import Path

from radiation_ss.blind.diagnosing import carry_out_one, result_file
from radiation_ss.blind.runner import read_manifest
from radiation_ss.blind.seal import lock_out, sealed_folder


def end_with_parent() -> None:
    """Wait for the end of standard input, which only the end of the parent brings, and end."""
    os.read(0, 1)
    os._exit(1)


def main() -> None:
    """Do the tasks that are not done, locked out of the sealed labels."""
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("tasks", nargs="+")
    parser.add_argument("--attached", action="store_true")
    args = parser.parse_args()
    lock_out(sealed_folder(args.folder))
    if args.attached:
        threading.Thread(target=end_with_parent, daemon=True).start()
    tolerance = read_manifest(args.folder)["tolerance"]
    for task in args.tasks:
        if not result_file(args.folder, task).exists():
            print(f"{task}: {carry_out_one(args.folder, task, tolerance)}", flush=True)


if __name__ == "__main__":
    main()
