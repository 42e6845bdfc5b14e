//! Placement of labels: none may cover another label or a point, or leave the page.

/// A rectangle on the page, pixels: left, top, right, bottom.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Frame {
    pub left: f64,
    pub top: f64,
    pub right: f64,
    pub bottom: f64,
}

impl Frame {
    /// Around a centre.
    pub(super) fn around((x, y): (f64, f64), (width, height): (f64, f64)) -> Self {
        Self {
            left: x - width / 2.0,
            top: y - height / 2.0,
            right: x + width / 2.0,
            bottom: y + height / 2.0,
        }
    }

    /// Squares of `side` that cover the line between two points.
    pub(super) fn along(from: (f64, f64), to: (f64, f64), side: f64) -> Vec<Self> {
        let (dx, dy) = (to.0 - from.0, to.1 - from.1);
        let count = (dx.hypot(dy) / side).ceil().max(1.0) as usize;
        let at = |i: usize| {
            let share = i as f64 / count as f64;
            (from.0 + share * dx, from.1 + share * dy)
        };
        (0..=count)
            .map(|i| Self::around(at(i), (side, side)))
            .collect()
    }

    fn meets(&self, other: &Self) -> bool {
        self.left < other.right
            && other.left < self.right
            && self.top < other.bottom
            && other.top < self.bottom
    }

    fn holds(&self, other: &Self) -> bool {
        self.left <= other.left
            && self.top <= other.top
            && self.right >= other.right
            && self.bottom >= other.bottom
    }
}

/// Directions from a point, best first: there are no points above and left of a front.
const DIRECTIONS: &[(f64, f64)] = &[
    (-1.0, -0.6),
    (-0.3, -1.0),
    (1.0, 0.6),
    (1.0, 0.0),
    (0.3, 1.0),
    (-1.0, 0.0),
    (1.0, -0.6),
    (-1.0, 0.6),
];

/// The frame of a label of `size` for the point `at`, inside `paper` and outside everything
/// `taken`; near the point if possible. `None` when there is no room.
pub(super) fn room(
    at: (f64, f64),
    size: (f64, f64),
    paper: &Frame,
    taken: &[Frame],
    unit: f64,
) -> Option<Frame> {
    let distances = [9.0, 22.0, 40.0, 60.0, 85.0, 115.0, 150.0];
    for distance in distances {
        for (dx, dy) in DIRECTIONS {
            // The label's nearest edge is `distance` away, regardless of its width.
            let x = at.0 + dx * (distance * unit + size.0 / 2.0);
            let y = at.1 + dy * (distance * unit + size.1 / 2.0);
            let frame = Frame::around((x, y), size);
            if paper.holds(&frame) && !taken.iter().any(|other| frame.meets(other)) {
                return Some(frame);
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAPER: Frame = Frame {
        left: 0.0,
        top: 0.0,
        right: 400.0,
        bottom: 300.0,
    };

    #[test]
    fn labels_of_crowded_points_stay_apart_and_on_the_paper() {
        let mut taken = Vec::new();
        for i in 0..8 {
            let at = (200.0 + 3.0 * f64::from(i), 150.0 - 2.0 * f64::from(i));
            let frame = room(at, (80.0, 12.0), &PAPER, &taken, 1.0).expect("there is room");
            assert!(PAPER.holds(&frame), "{frame:?}");
            assert!(
                !taken.iter().any(|other: &Frame| frame.meets(other)),
                "{frame:?}"
            );
            taken.push(frame);
        }
    }

    #[test]
    fn a_label_keeps_off_a_line() {
        let line = Frame::along((0.0, 300.0), (400.0, 0.0), 5.0);
        assert!(line.windows(2).all(|it| it[0].right >= it[1].left));
        let frame = room((200.0, 150.0), (90.0, 14.0), &PAPER, &line, 1.0).expect("room");
        assert!(!line.iter().any(|it| it.meets(&frame)), "{frame:?}");
    }

    #[test]
    fn a_label_larger_than_the_paper_has_no_room() {
        assert_eq!(room((5.0, 5.0), (500.0, 12.0), &PAPER, &[], 1.0), None);
    }
}
