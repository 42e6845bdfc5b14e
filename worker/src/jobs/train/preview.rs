//! The picture that comes with a checkpoint: for each person, a held-out frame beside its render.

use yoto_avatar::train::Preview;
use yoto_media::png::{self, Pixels, PngError};

/// Most people on the picture.
const PEOPLE: usize = 8;
/// Between two pictures, pixels.
const GAP: usize = 4;
/// Grey of the gaps.
const PAPER: u8 = 64;

/// The first people of `previews`, one per row: the frame left, the render right.
///
/// # Errors
/// When the pictures can't be encoded.
pub(super) fn sheet(previews: &[Preview]) -> Result<Vec<u8>, PngError> {
    let shown = &previews[..previews.len().min(PEOPLE)];
    let widest = shown.iter().map(|it| it.width).max().unwrap_or(0);
    let width = 2 * widest + GAP;
    let rows: usize = shown.iter().map(|it| it.height).sum();
    let height = rows + GAP * shown.len().saturating_sub(1);
    let mut rgb = vec![PAPER; width * height * 3];
    let mut top = 0;
    for preview in shown {
        for (left, pixels) in [(0, &preview.truth), (widest + GAP, &preview.render)] {
            for (y, row) in pixels.chunks_exact(3 * preview.width).enumerate() {
                let start = 3 * ((top + y) * width + left);
                rgb[start..start + row.len()].copy_from_slice(row);
            }
        }
        top += preview.height + GAP;
    }
    png::encode(Pixels::Rgb, width as u32, height as u32, &rgb)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn preview(width: usize, height: usize, truth: u8, render: u8) -> Preview {
        Preview {
            slot: 0,
            width,
            height,
            truth: vec![truth; width * height * 3],
            render: vec![render; width * height * 3],
        }
    }

    #[test]
    fn frames_stand_left_of_their_renders_one_person_per_row() {
        let png = sheet(&[preview(3, 2, 10, 20), preview(2, 3, 30, 40)]).expect("encodes");
        let sheet = image::load_from_memory(&png).expect("decodes").into_rgb8();
        assert_eq!(sheet.dimensions(), (10, 9));
        let at = |x, y| sheet.get_pixel(x, y)[0];
        assert_eq!((at(0, 0), at(2, 1), at(7, 0), at(9, 1)), (10, 10, 20, 20));
        assert_eq!((at(0, 6), at(1, 8), at(7, 6), at(8, 8)), (30, 30, 40, 40));
        assert_eq!((at(3, 0), at(0, 2), at(2, 6)), (PAPER, PAPER, PAPER));
    }

    #[test]
    fn a_crowd_is_cut() {
        let crowd = vec![preview(1, 1, 1, 2); PEOPLE + 5];
        let png = sheet(&crowd).expect("encodes");
        let sheet = image::load_from_memory(&png).expect("decodes");
        assert_eq!(sheet.height() as usize, PEOPLE + GAP * (PEOPLE - 1));
    }
}
