//! The shell of a hull: its outermost cells, where splats start.

/// Distance to the shell from which it has nothing in the place of a point, metres (docs/research/body.md).
const REPLACED: f32 = 0.03;

/// Cells of a hull with a neighbour outside.
pub(crate) struct Shell {
    /// Their width, metres.
    pub spacing: f64,
    /// Whether no frame shows how deep the trunk or the head is: bodies' measures bound it.
    pub depth_unseen: bool,
    /// `[N]` middles, metres.
    pub points: Vec<[f32; 3]>,
    /// `[N]` unit normals, outward.
    pub normals: Vec<[f32; 3]>,
}

impl Shell {
    pub(super) fn empty(spacing: f64) -> Self {
        Self {
            spacing,
            depth_unseen: false,
            points: Vec::new(),
            normals: Vec::new(),
        }
    }

    /// Whether a point of the shell is within [`REPLACED`] of `at`.
    pub(super) fn is_near(&self, at: [f32; 3]) -> bool {
        let square = |point: &[f32; 3]| (0..3).map(|a| (point[a] - at[a]).powi(2)).sum::<f32>();
        (self.points.iter()).any(|point| square(point) <= REPLACED * REPLACED)
    }
}

/// The mean direction of the empty cells that are at most two cells away; upward if it has none, as
/// for a cell alone.
pub(super) fn outward(full: impl Fn([isize; 3]) -> bool) -> [f32; 3] {
    let mut sum = [0f32; 3];
    for z in -2..=2isize {
        for y in -2..=2isize {
            for x in -2..=2isize {
                if !full([x, y, z]) {
                    for (sum, part) in sum.iter_mut().zip([x, y, z]) {
                        *sum += part as f32;
                    }
                }
            }
        }
    }
    let length = sum.iter().map(|v| v * v).sum::<f32>().sqrt();
    if length > 0.0 {
        sum.map(|v| v / length)
    } else {
        [0.0, 1.0, 0.0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_is_near_within_three_centimetres() {
        let shell = Shell {
            spacing: 0.01,
            depth_unseen: false,
            points: vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            normals: vec![[0.0, 1.0, 0.0]; 2],
        };
        assert!(shell.is_near([0.0, 1.0, 0.029]));
        assert!(!shell.is_near([0.0, 1.0, 0.031]));
        assert!(!Shell::empty(0.01).is_near([0.0; 3]));
    }
}
