-- When the service last looked at its clock.
CREATE TABLE service_clock (
    id        INTEGER PRIMARY KEY CHECK (id = 1),
    last_tick REAL NOT NULL
) STRICT;

-- Times by which the clock moved without time that the service spent: it was set, the machine slept, or the
-- service was down. `seconds` (below 0: the clock was set back) count for no time stamp up to `at`.
CREATE TABLE clock_steps (
    ord     INTEGER PRIMARY KEY AUTOINCREMENT,
    at      REAL NOT NULL,
    seconds REAL NOT NULL
) STRICT;
