//! Who may call what: keys, their scopes and their ends, workers' keys, and browsers.

mod bodies;
mod ends;
mod issuer;
mod sign_in;
mod sites;
mod table;
mod workers;
