"""How long `texproj status` takes as photos grow, half of them failed (not collected).

    python tests/bench_scale.py [PHOTOS ...]      by default 250 500 1000

For each number: seconds of processor time of `texproj status`, of the lineage alone, and of
`texproj register` where nothing is stale. Floor: 2 s of processor time for status of 1000 photos.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from scale_project import make_scale_project

from texproj.project import Project
from texproj.stages.lineage import registration_freshness


def processor_s(*words: str) -> float:
    """Processor time of a command, its start included."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(
        [sys.executable, "-m", "texproj", *words], stdout=subprocess.DEVNULL, check=False
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    print("photos  status s  lineage s  no-op register s")
    for count in map(int, sys.argv[1:] or ("250", "500", "1000")):
        with tempfile.TemporaryDirectory() as folder:
            root = Path(folder) / "many"
            make_scale_project(root, count)
            status = processor_s("status", str(root))
            begin = time.process_time()
            registration_freshness(Project.open(root))
            alone = time.process_time() - begin
            again = processor_s("register", str(root))
        print(f"{count:6d}  {status:8.2f}  {alone:9.2f}  {again:16.2f}")


if __name__ == "__main__":
    main()
