//! Lines, dots and boxes on a picture.

use image::{Rgb, RgbImage};

pub(crate) type Colour = Rgb<u8>;

/// Sets a pixel, if the picture has it.
pub(super) fn dot(picture: &mut RgbImage, x: i64, y: i64, colour: Colour) {
    if let (Ok(x), Ok(y)) = (u32::try_from(x), u32::try_from(y))
        && x < picture.width()
        && y < picture.height()
    {
        picture.put_pixel(x, y, colour);
    }
}

/// A filled disc.
pub(super) fn disc(picture: &mut RgbImage, [x, y]: [f64; 2], radius: f64, colour: Colour) {
    let reach = radius.ceil() as i64;
    let (column, row) = (x.round() as i64, y.round() as i64);
    for down in -reach..=reach {
        for across in -reach..=reach {
            if ((across * across + down * down) as f64) <= radius * radius {
                dot(
                    picture,
                    column.saturating_add(across),
                    row.saturating_add(down),
                    colour,
                );
            }
        }
    }
}

/// A line `thick` pixels wide. What is outside the picture is cut away first, since a wrong
/// camera puts ends millions of pixels off.
pub(crate) fn line(
    picture: &mut RgbImage,
    from: [f64; 2],
    to: [f64; 2],
    thick: f64,
    colour: Colour,
) {
    let size = [f64::from(picture.width()), f64::from(picture.height())];
    let Some([from, to]) = clipped(from, to, size) else {
        return;
    };
    let steps = (to[0] - from[0]).hypot(to[1] - from[1]).ceil().max(1.0);
    for step in 0..=steps as usize {
        let t = step as f64 / steps;
        let point = [0, 1].map(|i| from[i] + t * (to[i] - from[i]));
        disc(picture, point, thick / 2.0, colour);
    }
}

/// The part of a line inside a picture with a small border (Liang and Barsky).
fn clipped(from: [f64; 2], to: [f64; 2], size: [f64; 2]) -> Option<[[f64; 2]; 2]> {
    const BORDER: f64 = 8.0;
    let (mut enter, mut leave) = (0.0f64, 1.0f64);
    for axis in 0..2 {
        let (low, high) = (-BORDER - from[axis], size[axis] + BORDER - from[axis]);
        let along = to[axis] - from[axis];
        if !along.is_finite() {
            return None;
        }
        if along == 0.0 {
            if low > 0.0 || high < 0.0 {
                return None;
            }
            continue;
        }
        let (one, other) = (low / along, high / along);
        enter = enter.max(one.min(other));
        leave = leave.min(one.max(other));
    }
    let at = |t: f64| [0, 1].map(|i| from[i] + t * (to[i] - from[i]));
    (enter <= leave).then(|| [at(enter), at(leave)])
}

/// A filled rectangle.
pub(super) fn fill(picture: &mut RgbImage, x: u32, y: u32, size: [u32; 2], colour: Colour) {
    for row in y..(y + size[1]).min(picture.height()) {
        for column in x..(x + size[0]).min(picture.width()) {
            picture.put_pixel(column, row, colour);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_from_far_away_cross_the_picture_and_end() {
        let colour = Rgb([255; 3]);
        let lit = |picture: &RgbImage| picture.pixels().filter(|p| p[0] > 0).count();
        let mut picture = RgbImage::new(20, 10);
        line(&mut picture, [-1e12, 5.0], [1e12, 5.0], 1.0, colour);
        assert_eq!(lit(&picture), 20);
        let mut picture = RgbImage::new(20, 10);
        line(&mut picture, [1e3, 1e3], [2e3, 1e9], 1.0, colour);
        line(&mut picture, [f64::NAN, 0.0], [3.0, 3.0], 1.0, colour);
        assert_eq!(lit(&picture), 0);
        fill(&mut picture, 15, 8, [30, 30], colour);
        assert_eq!(lit(&picture), 10);
    }
}
