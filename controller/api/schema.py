"""The schema of the store, as the steps that lead to it: step n makes version n + 1.

A step that was shipped is never edited; a change is a new step at the end. Times are
seconds since 1970 (UTC), shares 0 to 1, values with structure are JSON.
"""

from __future__ import annotations

_FIRST = """
CREATE TABLE programs (
    name TEXT PRIMARY KEY,              -- as uploaded, a safe file name
    sha256 TEXT NOT NULL,               -- programs/<sha256>.ngc; several names may share one
    size INTEGER NOT NULL,              -- bytes
    lines INTEGER NOT NULL,
    uploaded_s REAL NOT NULL,
    uploaded_by TEXT NOT NULL
) STRICT;
CREATE INDEX programs_by_content ON programs (sha256);
CREATE TABLE checks (
    sha256 TEXT NOT NULL,               -- of the program
    machine TEXT NOT NULL,              -- sha256 of machine file, offsets and tools
    state TEXT NOT NULL CHECK (state IN ('waiting', 'running', 'passed', 'refused', 'failed')),
    progress REAL NOT NULL,
    result TEXT NOT NULL,               -- JSON: figures and notes, or sentence, line and column
    changed_s REAL NOT NULL,
    PRIMARY KEY (sha256, machine)
) STRICT;
CREATE TABLE runs (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    program TEXT NOT NULL,              -- name and content as they were then
    sha256 TEXT NOT NULL,
    began_s REAL NOT NULL,
    ended_s REAL,
    result TEXT NOT NULL,               -- 'running', 'completed', 'stopped', 'fault', 'lost'
    facts TEXT NOT NULL,                -- JSON: cut time, worst following error, recording, ...
    source TEXT UNIQUE                  -- the service's record it was read from
) STRICT;
CREATE TABLE alarms (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    at_s REAL NOT NULL,
    name TEXT NOT NULL,                 -- of the row in the fault table
    axis TEXT NOT NULL,
    sentence TEXT NOT NULL,
    facts TEXT NOT NULL,                -- JSON: key and values of what is said, recovery, recording, ...
    acknowledged_s REAL,
    acknowledged_by TEXT,
    source TEXT UNIQUE                  -- the service's line it was read from
) STRICT;
CREATE TABLE offsets (
    name TEXT PRIMARY KEY,              -- G54 .. G59
    facts TEXT NOT NULL,                -- JSON: origin_mm, turned_deg
    changed_s REAL NOT NULL,
    changed_by TEXT NOT NULL
) STRICT;
CREATE TABLE tools (
    number INTEGER PRIMARY KEY,
    facts TEXT NOT NULL,                -- JSON: name, radius_mm, length_mm, flute_mm
    changed_s REAL NOT NULL,
    changed_by TEXT NOT NULL
) STRICT;
CREATE TABLE settings (
    key TEXT PRIMARY KEY,
    value TEXT NOT NULL,                -- JSON
    changed_s REAL NOT NULL,
    changed_by TEXT NOT NULL
) STRICT;
CREATE TABLE users (
    name TEXT PRIMARY KEY,
    password TEXT NOT NULL,             -- argon2 hash
    role TEXT NOT NULL CHECK (role IN ('view', 'operate', 'set_up')),
    changed_s REAL NOT NULL
) STRICT;
CREATE TABLE tokens (
    sha256 TEXT PRIMARY KEY,            -- of the token; the token itself is shown once and not kept
    name TEXT NOT NULL UNIQUE,
    role TEXT NOT NULL CHECK (role IN ('view', 'operate', 'set_up')),
    made_s REAL NOT NULL,
    made_by TEXT NOT NULL
) STRICT;
CREATE TABLE audit (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    at_s REAL NOT NULL,
    user TEXT NOT NULL,
    address TEXT NOT NULL,
    action TEXT NOT NULL,
    detail TEXT NOT NULL,
    allowed INTEGER NOT NULL
) STRICT
"""

_LOG_INS = """
CREATE TABLE sessions (
    sha256 TEXT PRIMARY KEY,            -- of the cookie
    user TEXT NOT NULL,
    mark TEXT NOT NULL,                 -- of password and role as they were at the log-in
    began_s REAL NOT NULL,
    seen_s REAL NOT NULL                -- the last request, to a minute
) STRICT;
ALTER TABLE tokens ADD COLUMN expires_s REAL
"""  # NULL: it does not expire

_QUEUE = """
CREATE TABLE queue (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    place INTEGER NOT NULL,             -- in its order
    program TEXT NOT NULL,              -- name
    count INTEGER NOT NULL,             -- wanted
    done INTEGER NOT NULL,
    added_s REAL NOT NULL,
    added_by TEXT NOT NULL
) STRICT;
CREATE TABLE marks (
    key TEXT PRIMARY KEY,               -- how far somebody has looked at runs and alarms
    value TEXT NOT NULL,                -- JSON
    changed_s REAL NOT NULL,
    changed_by TEXT NOT NULL
) STRICT
"""

MIGRATIONS: tuple[str, ...] = (_FIRST, _LOG_INS, _QUEUE)
