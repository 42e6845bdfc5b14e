//! Text that several commands print.

mod capture_end;
mod job;
mod scores;
mod span;
mod table;
mod titles;

pub(crate) use capture_end::note_capture_end;
pub(crate) use job::{
    attempt_line, evaluate_summary, export_contents, job_detail, job_outcome, train_summary,
};
#[cfg(feature = "embedded")]
pub(crate) use scores::thousandfold;
pub(crate) use scores::{score_rows, scores_json, scores_table};
pub(crate) use span::{now, span};
pub(crate) use table::{say_deleted, size_of, table};
pub(crate) use titles::{Titles, kind, kind_word};
