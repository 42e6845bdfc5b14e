//! Options and limits of a fit.

/// Most frames that are fitted together. The equations of one take a fifth of a megabyte.
pub const MAX_FRAMES: usize = 10_000;

/// Options of a fit.
#[derive(Clone, Debug, PartialEq)]
pub struct FitOptions {
    /// Focal length of the camera, pixels. Without it the fit finds one between 0.6 and 3 times the longer
    /// side of the pictures, with a prior at 1.2 times.
    pub focal: Option<f64>,
    /// Height of the person, metres, which one camera can't measure; 1.72 if unknown.
    pub height: Option<f64>,
    /// Whether depths in space are BlazePose's own. Then a network finds better ones ([`lift`](crate::lift)), which has learned from
    /// BlazePose's errors.
    pub lift: bool,
    /// Whether the person stands upright on average. Then gravity is estimated from the poses.
    pub upright: bool,
}

impl Default for FitOptions {
    fn default() -> Self {
        Self {
            focal: None,
            height: None,
            lift: false,
            upright: true,
        }
    }
}
