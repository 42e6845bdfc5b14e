//! Whether clothes in two pictures have the same colours.

/// Levels that colours of one person differ by in different light and poses: lightness, and differences of channels.
const SPREAD: [f32; 3] = [32.0, 14.0, 14.0];
/// A body whose colours differ by more than this, in spreads, is another person.
pub const OTHER_COLOURS: f32 = 3.0;

/// Levels of red, green and blue as lightness, red less green, and yellow less blue.
pub fn opponent([red, green, blue]: [f32; 3]) -> [f32; 3] {
    [
        (red + green + blue) / 3.0,
        red - green,
        (red + green) / 2.0 - blue,
    ]
}

/// The difference of two colours of [`opponent`], spreads.
pub fn difference(one: &[f32; 3], other: &[f32; 3]) -> f32 {
    let off = |at: usize| (one[at] - other[at]) / SPREAD[at];
    off(0).hypot(off(1)).hypot(off(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shade_changes_lightness_alone() {
        let colour = opponent([120.0, 60.0, 30.0]);
        assert_eq!(colour, [70.0, 60.0, 60.0]);
        let lighter = opponent([140.0, 80.0, 50.0]);
        assert_eq!(difference(&colour, &lighter), 20.0 / SPREAD[0]);
        let blue = opponent([30.0, 60.0, 120.0]);
        assert!(difference(&colour, &blue) > OTHER_COLOURS);
    }
}
