//! The levels of pictures that a matting model expects, which its file does not give.

use super::MaskRequest;
use super::run::failed_at;
use crate::clip::{Clip, fault, for_each};
use crate::{ImportError, MattingModel};
use yoto_matting::{Levels, Matter};

/// Number of frames that are tried with each.
const FRAMES: usize = 4;
/// Least overlap of the masks with the expected ones.
const LEAST: f64 = 0.5;

/// The levels whose masks overlap most with the expected masks, with a note of all figures.
///
/// # Errors
/// When no masks are expected, or no levels give them.
pub(super) fn find(
    model: &MattingModel,
    matter: &mut Matter,
    clip: &Clip,
    wanted: &[MaskRequest],
    notes: &mut Vec<String>,
) -> Result<Levels, ImportError> {
    let known: Vec<(usize, &[u8])> = wanted
        .iter()
        .filter_map(|it| Some((it.frame, it.expected.as_deref()?)))
        .collect();
    let known: Vec<_> = known
        .iter()
        .step_by(known.len().div_ceil(FRAMES).max(1))
        .collect();
    if known.is_empty() {
        let message = "its file does not say which levels its pictures want: see its documentation, \
                       and give --matting-levels unit (0 to 1), signed (-1 to 1: MODNet), centred \
                       (-0.5 to 0.5: IS-Net, RMBG 1.4) or imagenet (U²-Net, BiRefNet, RMBG 2.0)";
        return Err(fault(&model.path, "MISSING", message));
    }
    let frames: Vec<usize> = known.iter().map(|(frame, _)| *frame).collect();
    let mut pictures = Vec::new();
    for_each(clip, &frames, |_, rgb| {
        pictures.push(rgb.to_vec());
        Ok(())
    })?;
    let size = clip.size.map(|side| side as usize);
    let mut found = Vec::new();
    for levels in Levels::ALL {
        matter.set_levels(levels);
        let (mut both, mut either) = (0, 0);
        for ((frame, expected), rgb) in known.iter().zip(&pictures) {
            let matte = matter.look(rgb, size, None);
            let matte = matte.map_err(|error| failed_at(*frame, &error))?;
            for (one, other) in matte.coverage.iter().zip(*expected) {
                let (one, other) = (*one > 127, *other > 127);
                both += usize::from(one && other);
                either += usize::from(one || other);
            }
        }
        found.push((both as f64 / either.max(1) as f64, levels));
    }
    found.sort_by(|one, other| other.0.total_cmp(&one.0));
    let words: Vec<String> = found
        .iter()
        .map(|(share, levels)| format!("{} {:.0} %", levels.name(), 100.0 * share))
        .collect();
    let words = words.join(", ");
    match found.first() {
        Some((share, levels)) if *share >= LEAST => {
            notes.push(format!(
                "{} agrees with the pose model's masks, by the levels of its pictures: {words}",
                model.name()
            ));
            Ok(*levels)
        }
        _ => {
            let message = format!(
                "its masks are not where the pose model sees the person, with any levels of its \
                 pictures: {words}"
            );
            Err(fault(&model.path, "MISMATCH", message))
        }
    }
}
