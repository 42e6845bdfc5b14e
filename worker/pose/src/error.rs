//! Errors of a fit.

use crate::options::MAX_FRAMES;

/// Why key points can't be fitted.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PoseError {
    /// There are no frames, or too many to fit together.
    #[error("frames: {0} frames: 1 to {MAX_FRAMES} can be fitted together")]
    FrameCount(usize),
    /// A frame doesn't come after the one before it.
    #[error("frame {frame}: index: the frame before it is {before}: indices must rise")]
    Order {
        /// The frame.
        frame: u32,
        /// The index before it.
        before: u32,
    },
    /// A list without one row per key point.
    #[error("frame {frame}: {field}: {found} points instead of {wanted}")]
    PointCount {
        /// The frame.
        frame: u32,
        /// `picture` or `space`.
        field: &'static str,
        /// Its rows.
        found: usize,
        /// Points of the set.
        wanted: usize,
    },
    /// A number that is not finite or not plausible.
    #[error("frame {frame}: {field}: {value} is not between {from} and {to}")]
    Value {
        /// The frame.
        frame: u32,
        /// The number's field, e.g. `picture[3][1]`.
        field: String,
        /// The number.
        value: f64,
        /// The smallest allowed.
        from: f64,
        /// The largest allowed.
        to: f64,
    },
    /// A frame shows too little of the person.
    #[error("frame {frame}: picture: {found} points were seen: a body needs {wanted}")]
    Unseen {
        /// The frame.
        frame: u32,
        /// Points with confidence.
        found: usize,
        /// Points needed.
        wanted: usize,
    },
    /// The points of a frame are too close together.
    #[error("frame {frame}: picture: the points lie within {pixels:.1} pixels")]
    Tiny {
        /// The frame.
        frame: u32,
        /// Their extent.
        pixels: f64,
    },
    /// A number for all frames that is out of range.
    #[error("{field}: {value} is not between {from} and {to}")]
    Setting {
        /// The field of the key points or options.
        field: &'static str,
        /// The number.
        value: f64,
        /// The smallest allowed.
        from: f64,
        /// The largest allowed.
        to: f64,
    },
    /// The equations of the fit have no solution in finite numbers.
    #[error("the fit found no pose near the key points: are they of one person?")]
    Unsolvable,
}
