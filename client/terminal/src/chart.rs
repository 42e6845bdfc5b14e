//! A curve as lines of text.

/// Height of a curve, lines.
const HEIGHT: usize = 10;
/// Width of a curve without its axis, characters.
const WIDTH: usize = 64;

/// The curve through `points` (x rising, y), with the largest and the smallest value at its axis, each written by `label`.
/// Points of the same column are averaged. Empty without two finite points.
pub fn chart(points: &[(f64, f64)], label: impl Fn(f64) -> String) -> String {
    let finite = |it: &&(f64, f64)| it.0.is_finite() && it.1.is_finite();
    let points: Vec<(f64, f64)> = points.iter().filter(finite).copied().collect();
    let [(begin, _), .., (end, _)] = points[..] else {
        return String::new();
    };
    let length = (end - begin).max(f64::MIN_POSITIVE);
    let mut sums = [(0.0, 0_u32); WIDTH];
    for (x, y) in &points {
        // Casts saturate, so the column is one of the curve's.
        let column = ((x - begin) / length * WIDTH as f64) as usize;
        let sum = &mut sums[column.min(WIDTH - 1)];
        *sum = (sum.0 + y, sum.1 + 1);
    }
    let means = sums.map(|(sum, count)| (count > 0).then(|| sum / f64::from(count)));
    let values = || means.iter().flatten().copied();
    let (low, high) = (
        values().fold(f64::INFINITY, f64::min),
        values().fold(f64::NEG_INFINITY, f64::max),
    );
    let height = (high - low).max(f64::MIN_POSITIVE);
    let line_of = |y: f64| {
        let line = ((high - y) / height * (HEIGHT - 1) as f64).round() as usize;
        line.min(HEIGHT - 1)
    };
    let (top, bottom) = (label(high), label(low));
    let axis = top.chars().count().max(bottom.chars().count());
    let lines = (0..HEIGHT).map(|line| {
        let label = match line {
            0 => &*top,
            _ if line == HEIGHT - 1 => &*bottom,
            _ => "",
        };
        let dots: String = means
            .iter()
            .map(|mean| match mean {
                Some(y) if line_of(*y) == line => '*',
                _ => ' ',
            })
            .collect();
        format!("{label:>axis$} |{}", dots.trim_end())
    });
    lines.collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_falling_curve_falls() {
        let points: Vec<(f64, f64)> = (0..=100).map(|x| (f64::from(x), f64::from(-x))).collect();
        let text = chart(&points, |y| format!("{y:.0}"));
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), HEIGHT);
        assert!(lines[0].starts_with("  -0 |*"), "{text}");
        assert!(lines[HEIGHT - 1].starts_with("-100 |  "), "{text}");
        assert!(lines[HEIGHT - 1].ends_with('*'), "{text}");
        assert_eq!(lines[HEIGHT - 1].chars().count(), 4 + 2 + WIDTH, "{text}");
        assert_eq!(text.matches('*').count(), WIDTH);
    }

    #[test]
    fn odd_curves_are_drawn_or_empty() {
        let label = |y: f64| y.to_string();
        assert_eq!(chart(&[], label), "");
        assert_eq!(chart(&[(1.0, 2.0), (2.0, f64::NAN)], label), "");
        assert_eq!(
            chart(&[(1.0, 2.0), (1.0, 2.0)], label).matches('*').count(),
            1
        );
        let wide = chart(&[(0.0, f64::MAX), (f64::MAX, f64::MIN)], label);
        assert!(wide.lines().count() == HEIGHT, "{wide}");
    }
}
