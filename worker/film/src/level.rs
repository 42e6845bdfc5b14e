//! Rotations from worlds with any axis up to one with y up.

use yoto_capture::skeleton::transform::{
    Vec3, apply, compose_axis_angle, cross, dot, length, rigid, rodrigues, scale,
};

/// The up axis of scenes and of imported motions.
pub(crate) const UP: Vec3 = [0.0, 1.0, 0.0];
/// Facing of a body at rest.
pub(crate) const FORWARD: Vec3 = [0.0, 0.0, 1.0];

/// The rotation, as an axis-angle, that takes `up`, along an axis, to y and the horizontal part of the direction
/// `ahead` to z.
pub(crate) fn levelled(up: Vec3, ahead: Vec3) -> Vec3 {
    let upright = scale(upright(up), -1.0);
    let [x, _, z] = apply(&rigid(rodrigues(upright), [0.0; 3]), ahead);
    if x.hypot(z) < 1e-3 * length(ahead).max(1e-3) {
        return upright;
    }
    compose_axis_angle(scale(UP, -x.atan2(z)), upright)
}

/// The axis-angle that takes y to `up`, which is along an axis.
pub(crate) fn upright(up: Vec3) -> Vec3 {
    let across = cross(UP, up);
    let (sine, cosine) = (length(across), dot(UP, up));
    if sine > 1e-6 {
        return scale(across, sine.atan2(cosine) / sine);
    }
    if cosine > 0.0 {
        [0.0; 3]
    } else {
        [std::f64::consts::PI, 0.0, 0.0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_capture::skeleton::transform::{rotate, sub};

    #[test]
    fn every_world_becomes_upright_with_its_direction_ahead() {
        for up in [UP, [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]] {
            for ahead in [[1.0, 0.2, 0.3], [-0.4, 1.0, -2.0]] {
                let rotation = rigid(rodrigues(levelled(up, ahead)), [0.0; 3]);
                assert!(length(sub(rotate(&rotation, up), UP)) < 1e-9, "{up:?}");
                let [x, _, z] = rotate(&rotation, ahead);
                assert!(x.abs() < 1e-9 && z > 0.0, "{up:?} {ahead:?}");
            }
        }
        // Straight up there is no direction ahead.
        assert_eq!(levelled(UP, UP), [0.0; 3]);
    }
}
