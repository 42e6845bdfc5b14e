//! How the pictures that a detector saw differ from the clip as it is shown, and the way back.

use super::detections::{Detection, Detections};
use super::point_turn::PointTurn;
use crate::Options;
use crate::clip::Stored;
use yoto_media::Orientation;

/// What was done to the clip's pictures, in this order, before a detector saw them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SeenAs {
    /// Factors on width and height.
    pub scale: [f64; 2],
    pub turn: Option<PointTurn>,
    /// Mirrored left to right, so that the detector took left for right.
    pub mirrored: bool,
}

impl SeenAs {
    /// As the clip is shown.
    pub const SHOWN: Self = Self {
        scale: [1.0; 2],
        turn: None,
        mirrored: false,
    };

    /// What the user says.
    pub fn of(options: &Options) -> Self {
        Self {
            turn: options.turn_points,
            mirrored: options.mirror_points,
            ..Self::SHOWN
        }
    }

    /// As a video's file has its pictures.
    pub fn stored(stored: Stored) -> Self {
        Self {
            scale: stored.pixel.map(|side| 1.0 / side),
            turn: match stored.orientation {
                Orientation::AsStored => None,
                Orientation::Clockwise => Some(PointTurn::ThreeQuarters),
                Orientation::Half => Some(PointTurn::Half),
                Orientation::CounterClockwise => Some(PointTurn::Quarter),
            },
            mirrored: false,
        }
    }

    /// Width and height of the pictures of a clip of `[width, height]`.
    pub fn size(&self, clip: [f64; 2]) -> [f64; 2] {
        let [width, height] = self.scaled(clip);
        match self.turn {
            Some(PointTurn::Quarter | PointTurn::ThreeQuarters) => [height, width],
            _ => [width, height],
        }
    }

    /// A note about what the user said; `None` if that is nothing.
    pub fn words(&self) -> Option<String> {
        let mut words = Vec::new();
        if self.mirrored {
            words.push("mirrored (--mirror-points)".to_owned());
        }
        if let Some(turn) = self.turn {
            words.push(format!("turned (--turn-points {})", turn.degrees()));
        }
        let changes = words.join(" and ");
        (!words.is_empty())
            .then(|| format!("the key points are {changes}, back to the clip as it is shown"))
    }

    fn scaled(&self, clip: [f64; 2]) -> [f64; 2] {
        [clip[0] * self.scale[0], clip[1] * self.scale[1]]
    }

    /// Where a point `[x, y]` of the pictures is in a clip of `[width, height]`.
    pub fn back(&self, [x, y]: [f64; 2], clip: [f64; 2]) -> [f64; 2] {
        let [width, height] = self.scaled(clip);
        let x = if self.mirrored {
            self.size(clip)[0] - x
        } else {
            x
        };
        let [x, y] = match self.turn {
            None => [x, y],
            Some(PointTurn::Quarter) => [y, height - x],
            Some(PointTurn::Half) => [width - x, height - y],
            Some(PointTurn::ThreeQuarters) => [width - y, x],
        };
        [x / self.scale[0], y / self.scale[1]]
    }

    /// The same of a direction in the camera's axes.
    fn direction_back(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        let x = if self.mirrored { -x } else { x };
        match self.turn {
            None => [x, y, z],
            Some(PointTurn::Quarter) => [y, -x, z],
            Some(PointTurn::Half) => [-x, -y, z],
            Some(PointTurn::ThreeQuarters) => [-y, x, z],
        }
    }

    /// Makes `found` that of a clip of `[width, height]`. Masks of other pictures are left out.
    pub fn apply_back(&self, found: &mut Detections, clip: [u32; 2]) {
        if *self == Self::SHOWN {
            return;
        }
        let others = found.set.other_sides();
        let people = found.frames.iter_mut().flat_map(|seen| &mut seen.people);
        for person in people {
            self.person_back(person, &others, clip.map(f64::from));
        }
    }

    fn person_back(&self, person: &mut Detection, others: &[usize], clip: [f64; 2]) {
        (person.mask, person.own) = (None, None);
        for [x, y, _] in &mut person.picture {
            [*x, *y] = self.back([*x, *y], clip);
        }
        for place in &mut person.space {
            *place = self.direction_back(*place);
        }
        if self.mirrored {
            exchange(&mut person.picture, others);
            exchange(&mut person.space, others);
        }
    }
}

/// Gives each point its counterpart's place.
fn exchange<T: Copy>(points: &mut [T], others: &[usize]) {
    let before = points.to_vec();
    for (point, other) in points.iter_mut().zip(others) {
        if let Some(place) = before.get(*other) {
            *point = *place;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where a point of a clip of 40 by 30 pixels is in the pictures.
    fn forth(seen: SeenAs, [x, y]: [f64; 2]) -> [f64; 2] {
        let [x, y] = [x * seen.scale[0], y * seen.scale[1]];
        let [width, height] = [40.0 * seen.scale[0], 30.0 * seen.scale[1]];
        let [x, y] = match seen.turn {
            None => [x, y],
            // The top of the clip is at the right.
            Some(PointTurn::Quarter) => [height - y, x],
            Some(PointTurn::Half) => [width - x, height - y],
            Some(PointTurn::ThreeQuarters) => [y, width - x],
        };
        let [across, _] = seen.size([40.0, 30.0]);
        [if seen.mirrored { across - x } else { x }, y]
    }

    #[test]
    fn every_change_has_a_way_back() {
        let turns = [
            PointTurn::Quarter,
            PointTurn::Half,
            PointTurn::ThreeQuarters,
        ];
        for turn in turns.map(Some).into_iter().chain([None]) {
            for mirrored in [false, true] {
                let scale = [0.5, 1.25];
                let seen = SeenAs {
                    scale,
                    turn,
                    mirrored,
                };
                let point = seen.back(forth(seen, [7.0, 11.0]), [40.0, 30.0]);
                assert!((point[0] - 7.0).hypot(point[1] - 11.0) < 1e-9, "{seen:?}");
                // A step in the pictures is a direction of the same kind.
                let seen = SeenAs {
                    scale: [1.0; 2],
                    ..seen
                };
                let [a, b] = [[3.0, 4.0], [5.0, 9.0]].map(|it| seen.back(it, [40.0, 30.0]));
                let step = seen.direction_back([2.0, 5.0, 1.0]);
                assert_eq!([b[0] - a[0], b[1] - a[1]], [step[0], step[1]], "{seen:?}");
            }
        }
    }

    #[test]
    fn stored_pictures_are_turned_the_other_way() {
        let stored = |orientation, pixel| SeenAs::stored(Stored { orientation, pixel });
        let seen = stored(Orientation::Clockwise, [2.0, 1.0]);
        // A clip of 40 by 30 whose file has pictures of 30 by 20.
        assert_eq!(seen.size([40.0, 30.0]), [30.0, 20.0]);
        // Turned clockwise, the file's first pixel is at the top right.
        assert_eq!(seen.back([0.0, 0.0], [40.0, 30.0]), [40.0, 0.0]);
        let seen = stored(Orientation::CounterClockwise, [1.0, 1.0]);
        assert_eq!(seen.back([0.0, 0.0], [40.0, 30.0]), [0.0, 30.0]);
    }
}
