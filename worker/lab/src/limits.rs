//! What limits the quality of a capture, in a sentence for people: the worst measure of the check, or,
//! if all of them pass, the region of the picture with most of the error.

use crate::captures::Recording;
use yoto_avatar::evaluate::RegionError;
use yoto_capture::Shard;
use yoto_capture::check::{Checker, Grade, Measure, MeasureKind};
use yoto_capture::skeleton::SkeletonError;

/// Measures that need no background in the pictures.
const MEASURES: [MeasureKind; 10] = [
    MeasureKind::Timing,
    MeasureKind::Silhouette,
    MeasureKind::Masks,
    MeasureKind::Views,
    MeasureKind::Jumps,
    MeasureKind::Jitter,
    MeasureKind::Precision,
    MeasureKind::Duplicates,
    MeasureKind::Blur,
    MeasureKind::Exposure,
];

/// A sentence on the capture of `recording`; `errors` are those of all measured pictures.
///
/// # Errors
/// If its skeleton is invalid.
pub(super) fn limit(
    recording: &Recording,
    errors: &[RegionError],
) -> Result<String, SkeletonError> {
    let report = measures(&recording.shard)?;
    Ok(format!("{}: {}", recording.name, sentence(&report, errors)))
}

fn measures(shard: &Shard) -> Result<Vec<Measure>, SkeletonError> {
    let mut checker = Checker::new(shard.track.clone())?;
    for position in checker.wanted().to_vec() {
        checker.look(position, &shard.image(position));
    }
    Ok(checker.finish().measures)
}

fn sentence(measures: &[Measure], errors: &[RegionError]) -> String {
    let known = measures.iter().filter(|it| MEASURES.contains(&it.kind));
    let poor = known.filter(|it| it.grade != Grade::Pass);
    // The first of the worst.
    let worst = poor.fold(None::<&Measure>, |worst, it| match worst {
        Some(worst) if worst.grade >= it.grade => Some(worst),
        _ => Some(it),
    });
    let most = errors
        .iter()
        .max_by(|a, b| a.share_of_error.total_cmp(&b.share_of_error));
    match (worst, most) {
        (Some(worst), _) => format!(
            "what limits this capture is its {} ({}): {}",
            worst.kind.title(),
            worst.shown,
            worst.meaning
        ),
        (None, Some(most)) => format!(
            "the check finds nothing that limits this capture; most of the error, {:.0} %, is in the region \"{}\"",
            100.0 * most.share_of_error,
            most.region.name()
        ),
        (None, None) => "the check finds nothing that limits this capture".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_avatar::evaluate::Region;

    fn measure(kind: MeasureKind, grade: Grade) -> Measure {
        Measure {
            kind,
            grade,
            value: None,
            shown: "3 of 12".into(),
            meaning: "the back will be guessed".into(),
            cause: None,
            frames: Vec::new(),
        }
    }

    #[test]
    fn the_worst_measure_is_named_and_otherwise_the_largest_error() {
        let errors =
            [(Region::Head, 0.2), (Region::Outline, 0.6)].map(|(region, share)| RegionError {
                region,
                share_of_error: share,
                share_of_pixels: 0.1,
                psnr: None,
                opacity: 0.0,
            });
        let all = [
            // Pictures without background agree with their masks by definition.
            measure(MeasureKind::ImageInMask, Grade::Fail),
            measure(MeasureKind::Blur, Grade::Warn),
            measure(MeasureKind::Views, Grade::Fail),
            measure(MeasureKind::Jitter, Grade::Fail),
        ];
        assert_eq!(
            sentence(&all, &errors),
            "what limits this capture is its view coverage (3 of 12): the back will be guessed"
        );
        let fine = [measure(MeasureKind::Views, Grade::Pass)];
        assert!(
            sentence(&fine, &errors)
                .ends_with("most of the error, 60 %, is in the region \"outline\"")
        );
    }
}
