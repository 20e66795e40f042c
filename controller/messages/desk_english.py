"""English: what the commands of the desk say that need no machine."""

from __future__ import annotations

LANGUAGE = "en"

REFUSALS = {
    # --- work that is spread
    "workers.lost": "{count} workers died one after the other with nothing done between; give less memory to "
    "others or take fewer --workers (1: the work is done in this process, and says what it dies of).",
    "workers.killed": "The cluster gave the work up ({why}); look into the logs of its workers.",
    "workers.no_dask": "--cluster needs dask.distributed: install directrix with its extra cluster "
    "(pip install 'directrix[cluster]').",
    "workers.no_scheduler": "--cluster {address}: no Dask scheduler answers there ({why}); start one with "
    "`dask scheduler`, and workers with `dask worker tcp://HOST:8786 --nthreads 1`.",
    "workers.no_workers": "--cluster {address}: this scheduler has no workers; start some with "
    "`dask worker {address} --nthreads 1`.",
    # --- check of a folder
    "folder.none": "{folder}: there is no part program in it; a folder is searched for {suffixes}.",
    "folder.report_alone": "--report belongs to a folder of programs, and {program} is none; name a folder.",
    "folder.title": "{folder} on {machine}",
    "folder.program": "program",
    "folder.verdict": "verdict",
    "folder.time": "time",
    "folder.blocks": "blocks",
    "folder.surfaces": "surfaces",
    "folder.overcut": "overcut",
    "folder.said": "what is said of it",
    "folder.passed": "passed",
    "folder.refused": "refused",
    "folder.failed": "failed",
    "folder.subs": "subs",
    "folder.only_subs": "Holds only subs; they are checked with the programs that call them.",
    "folder.more": "{sentence} ({more} more)",
    "folder.summed": "{count} programs: {passed} passed, {refused} refused, {failed} failed; {subs} files of "
    "subs.",
    "folder.written": "Report: {file}",
    # --- what needs a checkout
    "checkout.none": "{folder}: is not there; benchmarks and soak come with the checkout and not with the "
    "package: clone the repository, and run directrix from there (pip install -e '.[dev]').",
    # --- bench
    "bench.unknown": "{name}: there is no such benchmark; allowed are {known}.",
    "bench.failed": "Not measured: {names}; each says why above, or in benchmarks of --json.",
    "bench.parts": "its parts add up to {sum:.4f} %, not to 100",
    "bench.no_marks": "{file}: has no one place for the figures; write {begin} and {end} where they belong.",
    "bench.figure": "figure",
    "bench.value": "value",
    "bench.beside": "beside it",
    "bench.ratio": "ratio",
    "bench.promised": "promised",
    "bench.at_most": "at most {limit}",
    "bench.at_least": "at least {limit}",
    "bench.at_most_times": "at most {limit} times",
    "bench.of": "of {whole}",
    "bench.drawn": "Pictures: {folder}",
    # --- soak
    "soak.begins": "Seed {seed}.",
    "soak.held": "Seed {seed}: {runs} runs ({results}), {ticks} ticks, and all of it held.",
    "soak.wrong": "Seed {seed}: {runs} runs ({results}), {ticks} ticks; {wrong} did not hold, the first is "
    "kept in {folder}: see soak.json there, and make it again with `directrix replay {folder}`.",
    "soak.grown": "Seed {seed}: {runs} runs ({results}) held, but memory grew: {grown}.",
    # --- recordings
    "records.unreadable": "{path}: cannot be read as a recording ({why}); give a trace of simulate, or the "
    "folder of a fault or of a run.",
    "records.neither": "{path}: holds neither a trace nor a recording, but {names}; give a trace of "
    "simulate, or the folder of a fault or of a run.",
    "records.no_folder": "{folder}: has neither {trace} nor {run} with {machine}; give the folder of a "
    "fault or of a run.",
    "records.lacks": "{path}: is no recording of this version of Directrix: it has no {name}.",
    "records.no_pyarrow": "Parquet needs pyarrow: install directrix with its extra recordings "
    "(pip install 'directrix[recordings]').",
    "records.periods": "They have other periods, {a:g} and {b:g} ms: no row stands beside another; compare "
    "recordings of one period.",
    "records.nothing_common": "They have no column in common; compare recordings of one machine.",
    "records.units": "{name}: is in {a} in one and in {b} in the other; compare recordings of one machine.",
    "records.suffix": "{file}: recordings are written as Parquet; give a name that ends with .parquet.",
    "records.written": "{file}: {rows} rows of {columns} columns.",
    "records.same": "The same: {rows} rows of {columns} columns.",
    "records.lengths": "The same for {rows} rows, but one has {a} and the other {b}.",
    "records.apart": "Apart from row {row} on (at {time:.3f} s{at}): {name}, by {largest:.6g} {unit} at "
    "most.",
    "records.in_line": ", line {line}",
    "records.column": "column",
    "records.largest": "largest difference",
    "records.at": "in row",
    "records.first": "apart from row",
    # --- machine files
    "machine.rounding": "{axis}: rounding to counts at {ms:g} ms is worth a jerk of {jerk:.0f} {unit}/s3, "
    "{share:.0%} of its limit; {needed:.0f} counts per {unit} or a longer period is needed",
    "machine.sound": "{machine}: the drives' data sheets have all that it needs, and its buses carry it.",
}
