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
    "bench.promised": "zugesagt",
    "bench.at_most": "höchstens {limit}",
    "bench.at_least": "mindestens {limit}",
    "bench.at_most_times": "höchstens {limit}-mal",
    "bench.of": "von {whole}",
    "bench.drawn": "Bilder: {folder}",
    # --- soak
    "soak.begins": "Startzahl {seed}.",
    "soak.held": "Startzahl {seed}: {runs} Läufe ({results}), {ticks} Takte, und alles hielt.",
    "soak.wrong": "Startzahl {seed}: {runs} Läufe ({results}), {ticks} Takte; {wrong} hielten nicht, der "
    "erste liegt in {folder}: soak.json darin lesen, und mit `directrix replay {folder}` wiederholen.",
    "soak.grown": "Startzahl {seed}: {runs} Läufe ({results}) hielten, aber Speicher wuchs: {grown}.",
    # --- Aufzeichnungen
    "records.unreadable": "{path}: ist nicht als Aufzeichnung zu lesen ({why}); eine Spur von simulate "
    "angeben, oder den Ordner einer Störung oder eines Laufs.",
    "records.neither": "{path}: enthält weder eine Spur noch eine Aufzeichnung, sondern {names}; eine Spur "
    "von simulate angeben, oder den Ordner einer Störung oder eines Laufs.",
    "records.no_folder": "{folder}: hat weder {trace} noch {run} mit {machine}; den Ordner einer Störung "
    "oder eines Laufs angeben.",
    "records.lacks": "{path}: ist keine Aufzeichnung dieser Version von Directrix: {name} fehlt.",
    "records.no_pyarrow": "Parquet braucht pyarrow: directrix mit dem Extra recordings installieren "
    "(pip install 'directrix[recordings]').",
    "records.periods": "Sie haben verschiedene Takte, {a:g} und {b:g} ms: keine Zeile entspricht einer "
    "anderen; Aufzeichnungen mit gleichem Takt vergleichen.",
    "records.nothing_common": "Sie haben keine Spalte gemeinsam; Aufzeichnungen einer Maschine vergleichen.",
    "records.units": "{name}: ist einmal in {a} und einmal in {b}; Aufzeichnungen einer Maschine "
    "vergleichen.",
    "records.suffix": "{file}: Aufzeichnungen werden als Parquet geschrieben; einen Namen mit .parquet am "
    "Ende angeben.",
    "records.written": "{file}: {rows} Zeilen mit {columns} Spalten.",
    "records.same": "Gleich: {rows} Zeilen mit {columns} Spalten.",
    "records.lengths": "Gleich über {rows} Zeilen, aber die eine hat {a} und die andere {b}.",
    "records.apart": "Verschieden ab Zeile {row} (bei {time:.3f} s{at}): {name}, um höchstens "
    "{largest:.6g} {unit}.",
    "records.in_line": ", Programmzeile {line}",
    "records.column": "Spalte",
    "records.largest": "größte Abweichung",
    "records.at": "in Zeile",
    "records.first": "verschieden ab Zeile",
    # --- Maschinendateien
    "machine.rounding": "{axis}: Das Runden auf Inkremente bei {ms:g} ms macht einen Ruck von {jerk:.0f} "
    "{unit}/s3, {share:.0%} der Grenze; nötig sind {needed:.0f} Inkremente je {unit} oder ein längerer Takt",
    "machine.sound": "{machine}: Die Datenblätter der Antriebe haben alles, was sie braucht, und ihre Busse "
    "tragen es.",
}
