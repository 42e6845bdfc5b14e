//! The transformation from the pictures that a detector saw back to the clip as shown.

use super::detections::{Detection, Detections};
use super::point_rotation::PointRotation;
use crate::Options;
use crate::clip::StoredPicture;
use yoto_media::Orientation;

/// Changes to the clip's pictures before a detector saw them, in this order: scale, rotation, mirror.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PictureTransform {
    /// Factors on width and height.
    pub scale: [f64; 2],
    pub rotation: Option<PointRotation>,
    /// Mirrored left to right, so that the detector took left for right.
    pub mirrored: bool,
}

impl PictureTransform {
    /// The pictures of the clip as it is shown.
    pub(super) const SHOWN: Self = Self {
        scale: [1.0; 2],
        rotation: None,
        mirrored: false,
    };

    /// The changes that the user names.
    pub(super) fn of(options: &Options) -> Self {
        Self {
            rotation: options.point_rotation,
            mirrored: options.mirror_points,
            ..Self::SHOWN
        }
    }

    /// The pictures as a video's file stores them.
    pub(super) fn stored(stored: StoredPicture) -> Self {
        Self {
            scale: stored.pixel.map(|side| 1.0 / side),
            rotation: match stored.orientation {
                Orientation::AsStored => None,
                Orientation::Clockwise => Some(PointRotation::ThreeQuarters),
                Orientation::Half => Some(PointRotation::Half),
                Orientation::CounterClockwise => Some(PointRotation::Quarter),
            },
            mirrored: false,
        }
    }

    /// Width and height of the pictures of a clip of `[width, height]`.
    pub(super) fn size(&self, clip: [f64; 2]) -> [f64; 2] {
        let [width, height] = self.scaled(clip);
        match self.rotation {
            Some(PointRotation::Quarter | PointRotation::ThreeQuarters) => [height, width],
            _ => [width, height],
        }
    }

    /// A note about the changes that the user names; `None` without any.
    pub(super) fn words(&self) -> Option<String> {
        let mut words = Vec::new();
        if self.mirrored {
            words.push("mirrored (--mirror-points)".to_owned());
        }
        if let Some(rotation) = self.rotation {
            words.push(format!("turned (--turn-points {})", rotation.degrees()));
        }
        let changes = words.join(" and ");
        (!words.is_empty())
            .then(|| format!("the key points are {changes}, back to the clip as it is shown"))
    }

    fn scaled(&self, clip: [f64; 2]) -> [f64; 2] {
        [clip[0] * self.scale[0], clip[1] * self.scale[1]]
    }

    /// The position in a clip of `[width, height]` of the point `[x, y]` of the pictures.
    pub(super) fn back(&self, [x, y]: [f64; 2], clip: [f64; 2]) -> [f64; 2] {
        let [width, height] = self.scaled(clip);
        let x = if self.mirrored {
            self.size(clip)[0] - x
        } else {
            x
        };
        let [x, y] = match self.rotation {
            None => [x, y],
            Some(PointRotation::Quarter) => [y, height - x],
            Some(PointRotation::Half) => [width - x, height - y],
            Some(PointRotation::ThreeQuarters) => [width - y, x],
        };
        [x / self.scale[0], y / self.scale[1]]
    }

    /// The direction in the clip's camera axes of a direction in the pictures' camera axes.
    fn direction_back(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        let x = if self.mirrored { -x } else { x };
        match self.rotation {
            None => [x, y, z],
            Some(PointRotation::Quarter) => [y, -x, z],
            Some(PointRotation::Half) => [-x, -y, z],
            Some(PointRotation::ThreeQuarters) => [-y, x, z],
        }
    }

    /// Transforms `found` to a clip of `[width, height]`. Masks of other pictures are left out.
    pub(super) fn apply_back(&self, found: &mut Detections, clip: [u32; 2]) {
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
    fn forth(seen: PictureTransform, [x, y]: [f64; 2]) -> [f64; 2] {
        let [x, y] = [x * seen.scale[0], y * seen.scale[1]];
        let [width, height] = [40.0 * seen.scale[0], 30.0 * seen.scale[1]];
        let [x, y] = match seen.rotation {
            None => [x, y],
            // The top of the clip is at the right.
            Some(PointRotation::Quarter) => [height - y, x],
            Some(PointRotation::Half) => [width - x, height - y],
            Some(PointRotation::ThreeQuarters) => [y, width - x],
        };
        let [across, _] = seen.size([40.0, 30.0]);
        [if seen.mirrored { across - x } else { x }, y]
    }

    #[test]
    fn every_change_has_a_way_back() {
        let turns = [
            PointRotation::Quarter,
            PointRotation::Half,
            PointRotation::ThreeQuarters,
        ];
        for rotation in turns.map(Some).into_iter().chain([None]) {
            for mirrored in [false, true] {
                let scale = [0.5, 1.25];
                let seen = PictureTransform {
                    scale,
                    rotation,
                    mirrored,
                };
                let point = seen.back(forth(seen, [7.0, 11.0]), [40.0, 30.0]);
                assert!((point[0] - 7.0).hypot(point[1] - 11.0) < 1e-9, "{seen:?}");
                // A step in the pictures is a direction of the same kind.
                let seen = PictureTransform {
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
        let stored =
            |orientation, pixel| PictureTransform::stored(StoredPicture { orientation, pixel });
        let seen = stored(Orientation::Clockwise, [2.0, 1.0]);
        // A clip of 40 by 30 whose file has pictures of 30 by 20.
        assert_eq!(seen.size([40.0, 30.0]), [30.0, 20.0]);
        // Turned clockwise, the file's first pixel is at the top right.
        assert_eq!(seen.back([0.0, 0.0], [40.0, 30.0]), [40.0, 0.0]);
        let seen = stored(Orientation::CounterClockwise, [1.0, 1.0]);
        assert_eq!(seen.back([0.0, 0.0], [40.0, 30.0]), [0.0, 30.0]);
    }
}
