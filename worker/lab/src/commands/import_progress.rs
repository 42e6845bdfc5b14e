//! The progress of imports and checks on the terminal.

use yoto_import::{Progress, ProgressEvent};
use yoto_terminal::detail;
use yoto_terminal::progress::Activities;

/// A receiver that shows progress and details.
pub(crate) fn on_terminal() -> Progress {
    let shown = Activities::default();
    Progress::to(move |event| match event {
        ProgressEvent::Started(stage) => shown.start(stage.label()),
        ProgressEvent::Counted { stage, done, total } => {
            shown.update(|display| display.count(stage.unit(), done, total));
        }
        ProgressEvent::Written { done, total, bytes } => {
            shown.update(|display| display.frames(done, total, bytes));
        }
        ProgressEvent::Finished { outcome, .. } => shown.end(outcome),
        ProgressEvent::Detail(text) => detail!("{text}"),
    })
}
