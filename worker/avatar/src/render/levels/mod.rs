//! Levels of detail of a person of splats: fewer splats, each in place of a group of near ones of the same part of the
//! body.
//!
//! Groups grow pair by pair as Ward's clusters do (Ward, "Hierarchical grouping to optimize an objective function", 1963):
//! next are always the two whose union adds least to the squared differences within groups, weighted by area. A
//! group becomes the Gaussian of its moments.

mod clusters;
mod moments;

pub(super) use clusters::groups;
pub(super) use moments::merged;

/// A Gaussian in the rest pose, of any source.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LevelSplat {
    /// Metres.
    pub mean: [f32; 3],
    /// Unit quaternion, real part first; the third axis is the surface's normal.
    pub turn: [f32; 4],
    /// Standard deviations along the rotated axes, metres.
    pub deviations: [f32; 3],
    /// 0 to 1, at the centre.
    pub opacity: f32,
    pub colour: [f32; 3],
    /// The bone with the largest share.
    pub bone: u16,
}

impl LevelSplat {
    /// Opacity times the area of the two largest deviations, metres²: what the splat covers when it is seen from the front.
    fn weight(&self) -> f64 {
        let [a, b, c] = self.deviations.map(f64::from);
        f64::from(self.opacity) * (a * b).max(b * c).max(c * a)
    }
}

/// Number of splats of a level, of `all` that can be seen: at least one, unless there are none.
pub(super) fn count(all: usize, share: f32) -> usize {
    let wanted = (all as f64 * f64::from(share)).round() as usize;
    wanted.max(1).min(all)
}
