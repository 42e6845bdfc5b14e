//! Who may call what: keys, their scopes and their ends, workers' keys, and browsers.

mod ends;
mod sites;
mod table;
mod workers;
