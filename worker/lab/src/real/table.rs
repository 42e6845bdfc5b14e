//! The figures of all clips as one table.

use super::Clip;
use crate::split_regions::SplitRegions;
use yoto_avatar::evaluate::{Region, Score, SplitScores};

/// A row per clip and one of means: PSNR in the person's box on held-out frames between those of the training, at
/// their found poses and after these are fitted, the same on blocks of time that training did not see; head, hands
/// and outline on the former; LPIPS where it was measured; seconds.
pub fn table(clips: &[Clip]) -> String {
    let mut lines = vec![format!(
        "{:26} {:>6} {:>7} {:>7} {:>7} {:>7} {:>6} {:>6} {:>7} {:>6} {:>6} {:>7} {:>6} {:>7} {:>6}",
        "clip",
        "frames",
        "between",
        "fitted",
        "blocks",
        "fitted",
        "head",
        "hands",
        "outline",
        "ssim",
        "lpips",
        "import",
        "check",
        "training",
        "steps"
    )];
    let mut sums = [(0.0, 0usize); 9];
    for clip in clips {
        let Some(report) = &clip.report else {
            let why = clip.stopped.as_deref().unwrap_or("not measured");
            lines.push(format!("{:26} stopped: {why}", clip.name));
            continue;
        };
        let figures = figures(
            &report.mean,
            report.fitted.as_ref(),
            report.regions.as_ref(),
        );
        for (sum, figure) in sums.iter_mut().zip(figures) {
            if let Some(figure) = figure {
                *sum = (sum.0 + figure, sum.1 + 1);
            }
        }
        lines.push(format!(
            "{:26} {:>6} {} {:>7.0} {:>6.1} {:>8.0} {:>5}",
            clip.name,
            clip.frames,
            row(figures),
            clip.seconds.import,
            clip.seconds.check,
            report.train_seconds,
            report.steps
        ));
    }
    let means = sums.map(|(sum, count)| (count > 0).then(|| sum / count as f64));
    lines.push(format!("{:26} {:>6} {}", "mean", "", row(means)));
    lines.join("\n")
}

fn figures(
    mean: &SplitScores,
    fitted: Option<&SplitScores>,
    regions: Option<&SplitRegions>,
) -> [Option<f64>; 9] {
    let inside = |score: &Score| (score.pictures > 0).then_some(score.psnr_mask_box);
    let between = match mean.novel_view.pictures {
        0 => &mean.novel_pose,
        _ => &mean.novel_view,
    };
    let region = |wanted: Region| {
        let regions = regions?;
        let errors = match regions.novel_view.is_empty() {
            true => &regions.novel_pose,
            false => &regions.novel_view,
        };
        errors.iter().find(|it| it.region == wanted)?.psnr
    };
    [
        inside(&mean.novel_view),
        fitted.and_then(|it| inside(&it.novel_view)),
        inside(&mean.novel_pose),
        fitted.and_then(|it| inside(&it.novel_pose)),
        region(Region::Head),
        region(Region::Hands),
        region(Region::Outline),
        (between.pictures > 0).then_some(between.ssim),
        between.lpips,
    ]
}

fn row(figures: [Option<f64>; 9]) -> String {
    const WIDTHS: [usize; 9] = [7, 7, 7, 7, 6, 6, 7, 6, 6];
    let cell = |(index, figure): (usize, Option<f64>)| {
        let width = WIDTHS[index];
        let decimals = if index < 7 { 2 } else { 3 };
        figure.map_or_else(
            || format!("{:>width$}", "–"),
            |value| format!("{value:>width$.decimals$}"),
        )
    };
    let cells: Vec<String> = figures.into_iter().enumerate().map(cell).collect();
    cells.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::real::Seconds;

    #[test]
    fn a_clip_that_was_stopped_has_its_reason_and_no_part_in_the_mean() {
        let clip = |name: &str, stopped: Option<&str>| Clip {
            name: name.into(),
            frames: 40,
            doubts: Vec::new(),
            seconds: Seconds::default(),
            report: None,
            stopped: stopped.map(str::to_owned),
        };
        let table = table(&[clip("walk", Some("no person was found"))]);
        let lines: Vec<&str> = table.lines().collect();
        assert!(lines[1].starts_with("walk") && lines[1].ends_with("stopped: no person was found"));
        assert!(
            lines[2].starts_with("mean") && !lines[2].contains("0.00"),
            "{table}"
        );
    }
}
