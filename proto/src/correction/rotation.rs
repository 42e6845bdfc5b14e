//! Rotation of axis-angle rotations about the world's x axis.

/// `p` rotated by `degrees` about x.
pub(super) fn turned_about_x([x, y, z]: [f64; 3], degrees: f64) -> [f64; 3] {
    let (sin, cos) = degrees.to_radians().sin_cos();
    [x, cos * y - sin * z, sin * y + cos * z]
}

/// The axis-angle rotation `r` followed by `degrees` about x, as the shorter rotation.
pub(super) fn turned(r: [f64; 3], degrees: f64) -> [f64; 3] {
    let angle = r.iter().map(|v| v * v).sum::<f64>().sqrt();
    // sin(θ/2)/θ, by its limit where θ is tiny.
    let factor = if angle > 1e-9 {
        (angle / 2.0).sin() / angle
    } else {
        0.5
    };
    let (w, v) = ((angle / 2.0).cos(), r.map(|value| value * factor));
    let (s, c) = (degrees.to_radians() / 2.0).sin_cos();
    // The quaternion product (c, s x) (w, v).
    let mut w_out = c * w - s * v[0];
    let mut v_out = [c * v[0] + s * w, c * v[1] - s * v[2], c * v[2] + s * v[1]];
    if w_out < 0.0 {
        w_out = -w_out;
        v_out = v_out.map(|value| -value);
    }
    let sine = v_out.iter().map(|v| v * v).sum::<f64>().sqrt();
    if sine < 1e-12 {
        return [0.0; 3];
    }
    v_out.map(|value| value * 2.0 * sine.atan2(w_out) / sine)
}
