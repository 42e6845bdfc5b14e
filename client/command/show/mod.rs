//! Text that several commands print.

#[cfg(feature = "embedded")]
mod browser;
mod capture_end;
mod job;
mod scores;
mod span;
mod titles;
mod words;

#[cfg(feature = "embedded")]
pub(crate) use browser::in_browser;
pub(crate) use capture_end::note_capture_end;
pub(crate) use job::{
    attempt_line, evaluate_summary, export_contents, job_detail, job_outcome, train_summary,
};
pub(crate) use scores::score_rows;
pub(crate) use span::{now, span};
pub(crate) use titles::{ID, Titles, kind, kind_word};
pub(crate) use words::{say_deleted, size_of};
pub(crate) use yoto_terminal::table::table;
