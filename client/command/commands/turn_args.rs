//! Options that say whose turn a new job is.

use clap::{Args, ValueEnum};
use yoto_client::{Turn, YotoClient};
use yoto_proto::v1::JobPriority;

/// The turn of a new job.
#[derive(Debug, Args)]
pub(super) struct TurnArgs {
    /// Jobs of a higher priority are started first.
    #[arg(long, value_enum, default_value = "normal", value_name = "PRIORITY")]
    priority: PriorityName,
    /// For whom the job runs: of equals, the owner with the fewest running jobs comes first.
    #[arg(
        long,
        default_value = "",
        hide_default_value = true,
        value_name = "NAME"
    )]
    owner: String,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum PriorityName {
    Low,
    Normal,
    High,
    Urgent,
}

impl TurnArgs {
    /// The connection, whose new jobs have this turn.
    pub(super) fn on(&self, client: YotoClient) -> YotoClient {
        client.with_turn(Turn {
            priority: match self.priority {
                PriorityName::Low => JobPriority::Low,
                PriorityName::Normal => JobPriority::Normal,
                PriorityName::High => JobPriority::High,
                PriorityName::Urgent => JobPriority::Urgent,
            },
            owner: self.owner.clone(),
        })
    }
}
