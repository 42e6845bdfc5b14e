//! The pictures of a render, range by range: those of other workers are none of this lease's.

use super::committed::Committed;
use crate::jobs::{JobContext, JobFailure};
use std::time::Duration;

/// Pause before another look at what other workers draw.
const LOOK: Duration = Duration::from_millis(250);

/// Draws the ranges of `total` pictures that this lease gets, each by `picture`, until all are drawn; a lease
/// that `helps` ends once none are left for it. Draws none if the coordinator knows no ranges.
pub(super) fn draw(
    context: &JobContext,
    total: usize,
    helps: bool,
    files: &mut Committed<'_>,
    picture: &mut impl FnMut(usize, &mut Committed<'_>) -> Result<(), JobFailure>,
) -> Result<(), JobFailure> {
    if total == 0 {
        return Ok(());
    }
    let pictures = u32::try_from(total).unwrap_or(u32::MAX);
    let mut drawn = None;
    while let Some(taken) = context.take_range(pictures, drawn)? {
        drawn = taken.range.as_ref().map(|range| range.first);
        let before = (taken.committed as usize).saturating_sub(taken.outputs.len());
        files.learn(taken.outputs);
        let Some(range) = taken.range else {
            if taken.finished || helps {
                break;
            }
            context.report_pieces("rendering", before.min(total), total);
            context.wait(LOOK)?;
            continue;
        };
        for (done, place) in (range.first..range.first + range.count).enumerate() {
            context.check()?;
            context.report_pieces("rendering", (before + done).min(total), total);
            picture(place as usize, files)?;
        }
    }
    Ok(())
}
