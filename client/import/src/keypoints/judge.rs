//! Judges key points of any source by what is true of every film of a person: they lie in its pictures, they are as far apart as a
//! body's, and they move as a body moves. A fit finds a body for any points, so that what is wrong would be a capture of nobody.

use super::detections::{Detection, SURE};
use crate::ImportError;
use crate::clip::fault;
use std::path::Path;

/// Below this share of sure points inside the pictures, the points are of other pictures.
const REFUSED: f64 = 0.5;
/// Below this share, they are doubted.
const DOUBTED: f64 = 0.8;
/// Most points above and beside the pictures of a person whom the lower edge cuts off, as shares.
const ABOVE: f64 = 0.1;
const BESIDE: f64 = 0.3;
/// Factors between the pictures of the points and the clip's that are tried, and the share inside that names one.
const FACTORS: [f64; 8] = [1.25, 1.5, 2.0, 2.5, 3.0, 4.0, 6.0, 8.0];
const EXPLAINED: f64 = 0.95;
/// Least height or width of a person, pixels.
const LEAST: f64 = 8.0;
/// A frame in which the points move by more than this share of the body, on average, shows another person or none.
const WILD: f64 = 0.5;
/// Share of the frames that may.
const MOST_WILD: f64 = 0.2;

/// Judges the points of a person in frames of pictures of `size`. Returns doubts. Where masks or a camera of the detector say that they
/// are of the clip, `are_proven`, and whatever is odd is only a doubt.
///
/// # Errors
/// When they can't be of the person in the clip; `at` are the detector's files.
pub(super) fn judge(
    seen: &[(usize, &Detection)],
    size: [u32; 2],
    at: &Path,
    are_proven: bool,
) -> Result<Vec<String>, ImportError> {
    let unsuitable = |message| Err(fault(at, "UNSUITABLE", message));
    let [width, height] = size;
    let inside = inside(seen, size, 1.0);
    let lie = format!(
        "{:.0} % of the key points lie outside of the pictures of {width}x{height}",
        100.0 * (1.0 - inside)
    );
    let reach = reach(seen);
    let factor = FACTORS
        .into_iter()
        .find(|by| self::inside(seen, size, *by) >= EXPLAINED);
    let larger = factor.map(|by| {
        let sides = size.map(|side| (f64::from(side) * by).round());
        format!(
            "they fit pictures that are {by} times as large, {}x{}, or larger: did the detector see such ones? Then give that clip",
            sides[0], sides[1]
        )
    });
    if inside < REFUSED && !are_proven && !is_cut_off(seen, size) {
        let why = larger.unwrap_or_else(|| {
            "are they of this clip, in pixels from its upper left corner?".to_owned()
        });
        return unsuitable(format!("{lie} (x {}, y {}): {why}", reach[0], reach[1]));
    }
    let extents = || {
        seen.iter()
            .filter_map(|(frame, it)| Some((*frame, extent(it)?)))
    };
    let common = median(extents().map(|(_, it)| it).collect());
    if common.is_some_and(|it| it < LEAST)
        && let Some((frame, extent)) = extents().find(|(_, it)| *it < LEAST)
        && !are_proven
    {
        return unsuitable(format!(
            "frame {frame}: the key points are {extent:.1} pixels apart at most, and in most frames as near: those of a person are needed, \
             in pixels or as shares of the picture's width and height"
        ));
    }
    let mut doubts = Vec::new();
    if inside < DOUBTED {
        // A person whom the picture cuts off, or one in larger pictures.
        doubts.push(lie);
    }
    doubts.extend(wild(seen));
    Ok(doubts)
}

/// Share of the sure points that lie in the pictures when they are divided by `by`.
fn inside(seen: &[(usize, &Detection)], size: [u32; 2], by: f64) -> f64 {
    let [width, height] = size.map(|side| f64::from(side) * by);
    let (mut inside, mut all) = (0_u32, 0_u32);
    for [x, y, _] in sure(seen) {
        all += 1;
        inside += u32::from((0.0..=width).contains(&x) && (0.0..=height).contains(&y));
    }
    f64::from(inside) / f64::from(all.max(1))
}

/// Whether the lower edge cuts the person off, below which detectors guess the rest: a bust, or somebody before a webcam.
fn is_cut_off(seen: &[(usize, &Detection)], size: [u32; 2]) -> bool {
    let [width, height] = size.map(f64::from);
    let [mut all, mut above, mut beside, mut below] = [0.0; 4];
    for [x, y, _] in sure(seen) {
        all += 1.0;
        above += f64::from(u8::from(y < 0.0));
        beside += f64::from(u8::from(!(0.0..=width).contains(&x)));
        below += f64::from(u8::from(y > height));
    }
    above <= ABOVE * all && beside <= BESIDE * all && below > beside
}

/// From where to where the sure points reach along each axis.
fn reach(seen: &[(usize, &Detection)]) -> [String; 2] {
    [0, 1].map(|axis: usize| {
        let values = || sure(seen).map(|point| point[axis]);
        let (least, most) = (
            values().fold(f64::MAX, f64::min),
            values().fold(f64::MIN, f64::max),
        );
        format!("{least:.0} to {most:.0}")
    })
}

fn sure<'a>(seen: &'a [(usize, &'a Detection)]) -> impl Iterator<Item = [f64; 3]> + 'a {
    let points = seen.iter().flat_map(|(_, it)| &it.picture);
    points.filter(|point| point[2] > SURE).copied()
}

/// The longer side of the box around the sure points.
fn extent(detection: &Detection) -> Option<f64> {
    let [left, top, right, bottom] = detection.bounds()?;
    Some((right - left).max(bottom - top))
}

/// A doubt if the points leap from frame to frame. Frames that do not follow each other tell nothing.
fn wild(seen: &[(usize, &Detection)]) -> Option<String> {
    let moves = seen.windows(2).filter_map(|pair| {
        let [(before, a), (after, b)] = pair else {
            return None;
        };
        (after - before == 1).then_some(())?;
        let body = extent(a)?;
        let both = a.picture.iter().zip(&b.picture);
        let both = both.filter(|(a, b)| a[2] > SURE && b[2] > SURE);
        let moved: Vec<f64> = both
            .map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1]))
            .collect();
        let mean = moved.iter().sum::<f64>() / moved.len().max(1) as f64;
        Some(mean / body.max(1.0))
    });
    let moves: Vec<f64> = moves.collect();
    let leaps = moves.iter().filter(|it| **it > WILD).count();
    (leaps as f64 > MOST_WILD * moves.len() as f64).then(|| {
        format!(
            "the key points leap by more than half of the body in {leaps} of {} frames: are they of one person?",
            moves.len()
        )
    })
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [u32; 2] = [720, 1280];

    /// A person of 20 points between (300, 200) and (400, 960) in ten frames, changed by `change`.
    fn judged(change: impl Fn(usize, [f64; 2]) -> [f64; 2]) -> Result<Vec<String>, String> {
        let frames: Vec<Detection> = (0..10)
            .map(|frame| {
                let point = |at: usize| {
                    let place = [300.0 + 100.0 * (at % 2) as f64, 200.0 + 40.0 * at as f64];
                    let [x, y] = change(frame, place);
                    [x, y, 0.9]
                };
                Detection {
                    person: None,
                    picture: (0..20).map(point).collect(),
                    space: Vec::new(),
                    mask: None,
                    own: None,
                    hands: [None, None],
                    face: None,
                }
            })
            .collect();
        let seen: Vec<(usize, &Detection)> = frames.iter().enumerate().collect();
        judge(&seen, SIZE, Path::new("points.json"), false).map_err(|error| error.to_string())
    }

    #[test]
    fn a_person_in_the_pictures_is_not_doubted() {
        assert_eq!(judged(|_, at| at), Ok(Vec::new()));
        // Half of the body is beyond the lower edge, where detectors guess.
        let low = judged(|_, [x, y]| [x, y + 600.0]).expect("is read");
        assert!(
            low[0].starts_with("35 % of the key points lie outside"),
            "{low:?}"
        );
    }

    #[test]
    fn whoever_is_cut_off_is_only_doubted() {
        // The head and the shoulders are in the picture.
        let bust = judged(|_, [x, y]| [x, 3.0 * y + 100.0]).expect("is read");
        assert!(bust[0].starts_with("75 % of"), "{bust:?}");
    }

    #[test]
    fn points_of_other_pictures_are_refused_with_the_factor() {
        let error = judged(|_, [x, y]| [2.0 * x, 2.0 * y]).expect_err("is refused");
        assert!(
            error.contains("1.5 times as large, 1080x1920, or larger"),
            "{error}"
        );
        assert!(error.contains("x 600 to 800, y 400 to 1920"), "{error}");
    }

    #[test]
    fn points_in_space_are_refused() {
        let error = judged(|_, [x, y]| [x - 350.0, y - 1000.0]).expect_err("millimetres");
        assert!(error.contains("from its upper left corner"), "{error}");
        let error = judged(|_, [x, y]| [x / 500.0, y / 500.0]).expect_err("metres");
        assert!(error.contains("1.5 pixels apart"), "{error}");
    }

    #[test]
    fn points_that_leap_are_doubted() {
        let doubts = judged(|frame, [x, y]| [x + if frame % 2 == 0 { 0.0 } else { -299.0 }, y]);
        assert_eq!(doubts, Ok(Vec::new()), "a quick step to the side");
        let doubts = judged(|frame, [x, y]| match frame % 2 {
            0 => [x, y],
            _ => [700.0 - x, 1280.0 - y],
        });
        let doubts = doubts.expect("is read");
        assert!(doubts[0].contains("leap"), "{doubts:?}");
    }
}
