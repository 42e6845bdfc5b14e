//! The pictures of a render, shared among workers range by range.

use super::committed::Committed;
use crate::jobs::{JobContext, JobFailure};
use std::time::Duration;

/// Pause before another look at what other workers draw.
const LOOK: Duration = Duration::from_millis(250);

/// Draws the ranges of `total` pictures that this lease gets, each picture by `draw_one`, until all are drawn. A
/// lease that `helps` ends once no range is left for it. Draws none if the coordinator knows no ranges.
pub(super) fn draw_ranges(
    context: &JobContext,
    total: usize,
    helps: bool,
    files: &mut Committed<'_>,
    draw_one: &mut impl FnMut(usize, &mut Committed<'_>) -> Result<(), JobFailure>,
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
        for (done, index) in (range.first..range.first + range.count).enumerate() {
            context.check()?;
            context.report_pieces("rendering", (before + done).min(total), total);
            draw_one(index as usize, files)?;
        }
    }
    Ok(())
}
