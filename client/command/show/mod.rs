//! Text that several commands print.

mod capture_end;
mod job;
mod scores;
mod span;
mod table;
mod titles;

pub(crate) use capture_end::note_capture_end;
pub(crate) use job::{attempt, contents, detail, evaluation, exported, outcome, training};
pub(crate) use scores::{rows, scores_json, scores_table, thousandfold};
pub(crate) use span::{now, span};
pub(crate) use table::{say_deleted, size_of, table};
pub(crate) use titles::{Titles, kind, kind_word};
