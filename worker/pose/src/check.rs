//! Checks of key points before a fit, so that the code behind them never gets a hostile number.

use crate::options::{FitOptions, MAX_FRAMES};
use crate::{FrameKeyPoints, KeyPoints, PoseError};

/// Least confidence of a point that is used.
pub(crate) const SEEN: f64 = 0.05;
/// Fewest seen points of a frame. Fewer don't determine the six degrees of freedom of a body in space.
const FEWEST: usize = 4;
/// Smallest body, pixels.
const SMALLEST: f64 = 4.0;
/// Largest distance of a point from the picture's corner, pixels.
const FARTHEST: f64 = 1e5;
/// Largest coordinate of a point in space, metres.
const METRES: f64 = 1e3;

/// Checks that `points` can be fitted.
pub(crate) fn check(points: &KeyPoints, options: &FitOptions) -> Result<(), PoseError> {
    let setting = |field, value: f64, from, to| {
        if (from..=to).contains(&value) {
            return Ok(());
        }
        Err(PoseError::Setting {
            field,
            value,
            from,
            to,
        })
    };
    let [width, height] = points.image_size.map(f64::from);
    setting("image_size[0]", width, 1.0, 8192.0)?;
    setting("image_size[1]", height, 1.0, 8192.0)?;
    setting("fps", points.fps, 0.01, 1000.0)?;
    if let Some(focal) = options.focal {
        let longer = width.max(height);
        setting("focal", focal, 0.1 * longer, 100.0 * longer)?;
    }
    if let Some(height) = options.height {
        setting("height", height, 0.3, 3.0)?;
    }
    let count = points.frames.len();
    if !(1..=MAX_FRAMES).contains(&count) {
        return Err(PoseError::FrameCount(count));
    }
    for pair in points.frames.windows(2) {
        if let [before, frame] = pair
            && frame.index <= before.index
        {
            return Err(PoseError::Order {
                frame: frame.index,
                before: before.index,
            });
        }
    }
    for frame in &points.frames {
        check_frame(frame, points.set.points())?;
    }
    Ok(())
}

fn check_frame(frame: &FrameKeyPoints, wanted: usize) -> Result<(), PoseError> {
    let has_space = !frame.space.is_empty();
    for (field, found, needed) in [
        ("picture", frame.picture.len(), true),
        ("space", frame.space.len(), has_space),
    ] {
        if needed && found != wanted {
            return Err(PoseError::PointCount {
                frame: frame.index,
                field,
                found,
                wanted,
            });
        }
    }
    let value = |field: &str, point: usize, axis: usize, value: f64, from: f64, to: f64| {
        if (from..=to).contains(&value) {
            return Ok(());
        }
        Err(PoseError::Value {
            frame: frame.index,
            field: format!("{field}[{point}][{axis}]"),
            value,
            from,
            to,
        })
    };
    for (at, &[x, y, confidence]) in frame.picture.iter().enumerate() {
        value("picture", at, 0, x, -FARTHEST, FARTHEST)?;
        value("picture", at, 1, y, -FARTHEST, FARTHEST)?;
        value("picture", at, 2, confidence, 0.0, 1.0)?;
    }
    for (at, point) in frame.space.iter().enumerate() {
        for (axis, &number) in point.iter().enumerate() {
            value("space", at, axis, number, -METRES, METRES)?;
        }
    }
    let found = seen(frame).count();
    if found < FEWEST {
        return Err(PoseError::Unseen {
            frame: frame.index,
            found,
            wanted: FEWEST,
        });
    }
    let pixels = extent(frame);
    if pixels < SMALLEST {
        return Err(PoseError::Tiny {
            frame: frame.index,
            pixels,
        });
    }
    Ok(())
}

/// The seen points of a frame.
fn seen(frame: &FrameKeyPoints) -> impl Iterator<Item = &[f64; 3]> {
    frame.picture.iter().filter(|point| point[2] >= SEEN)
}

/// The longer side of the box around a frame's seen points, pixels.
pub(crate) fn extent(frame: &FrameKeyPoints) -> f64 {
    let side = |axis: usize| {
        let values = || seen(frame).map(move |point| point[axis]);
        let most = values().fold(f64::NEG_INFINITY, f64::max);
        most - values().fold(f64::INFINITY, f64::min)
    };
    side(0).max(side(1))
}
