"""German: what the commands of the desk say that need no machine."""

from __future__ import annotations

LANGUAGE = "de"

REFUSALS = {
    # --- work that is spread
    "workers.lost": "{count} Prozesse starben nacheinander, ohne dass dazwischen etwas fertig wurde; anderen "
    "weniger Speicher geben oder weniger --workers nehmen (1: dieser Prozess arbeitet selbst und sagt, woran "
    "er stirbt).",
    "workers.killed": "Der Cluster hat die Arbeit aufgegeben ({why}); in die Protokolle seiner Worker sehen.",
    "workers.no_dask": "--cluster braucht dask.distributed: directrix mit dem Extra cluster installieren "
    "(pip install 'directrix[cluster]').",
    "workers.no_scheduler": "--cluster {address}: Dort antwortet kein Dask-Scheduler ({why}); einen mit "
    "`dask scheduler` starten, und Worker mit `dask worker tcp://HOST:8786 --nthreads 1`.",
    "workers.no_workers": "--cluster {address}: Dieser Scheduler hat keine Worker; welche starten mit "
    "`dask worker {address} --nthreads 1`.",
    # --- check of a folder
    "folder.none": "{folder}: Darin ist kein Teileprogramm; gesucht werden {suffixes}.",
    "folder.report_alone": "--report gehört zu einem Ordner mit Programmen, und {program} ist keiner; einen "
    "Ordner nennen.",
    "folder.title": "{folder} auf {machine}",
    "folder.program": "Programm",
    "folder.verdict": "Urteil",
    "folder.time": "Dauer",
    "folder.blocks": "Sätze",
    "folder.surfaces": "Flächen",
    "folder.overcut": "Unterschnitt",
    "folder.said": "was dazu gesagt wird",
    "folder.passed": "bestanden",
    "folder.refused": "abgelehnt",
    "folder.failed": "misslungen",
    "folder.subs": "Unterprogramme",
    "folder.only_subs": "Enthält nur Unterprogramme; sie werden mit den Programmen geprüft, die sie rufen.",
    "folder.more": "{sentence} ({more} weitere)",
    "folder.summed": "{count} Programme: {passed} bestanden, {refused} abgelehnt, {failed} misslungen; "
    "{subs} Dateien mit Unterprogrammen.",
    "folder.written": "Bericht: {file}",
    # --- was einen Klon des Repositorys braucht
    "checkout.none": "{folder}: gibt es nicht; Benchmarks und Dauerlauf gehören zum Klon, nicht zum Paket: "
    "das Repository klonen und directrix von dort starten (pip install -e '.[dev]').",
    # --- bench
    "bench.unknown": "{name}: Diesen Benchmark gibt es nicht; erlaubt sind {known}.",
    "bench.failed": "Nicht gemessen: {names}; warum, steht oben, oder in benchmarks von --json.",
    "bench.parts": "seine Teile ergeben {sum:.4f} %, nicht 100",
    "bench.no_marks": "{file}: hat nicht genau eine Stelle für die Zahlen; {begin} und {end} dorthin "
    "schreiben, wo sie stehen sollen.",
    "bench.figure": "Größe",
    "bench.value": "Wert",
    "bench.beside": "daneben",
    "bench.ratio": "Verhältnis",
    "bench.of": "von {whole}",
    "bench.drawn": "Bilder: {folder}",
}
