//! States of jobs.

use yoto_proto::v1::job;

/// Whether `state` is terminal.
pub fn is_terminal(state: job::State) -> bool {
    matches!(
        state,
        job::State::Succeeded | job::State::Failed | job::State::Cancelled
    )
}
