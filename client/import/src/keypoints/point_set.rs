//! Sets of points that detectors have: their counts, the names of their points, and how they become those of a fit.

use yoto_pose::KeyPointSet;

/// Name in notes of an unknown detector.
pub(super) const NAME: &str = "the detector";

/// A set of points, by the name that `--points` takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum PointSet {
    /// COCO's 17: nose, eyes, ears, shoulders, elbows, wrists, hips, knees, ankles.
    #[value(name = "coco17")]
    Coco17,
    /// OpenPose's 25.
    #[value(name = "body25")]
    Body25,
    /// The 33 landmarks of BlazePose (MediaPipe).
    #[value(name = "blazepose33")]
    Blazepose33,
    /// Halpe's 26: COCO's, then head, neck, hip, toes and heels.
    #[value(name = "halpe26")]
    Halpe26,
}

const COCO: [&str; 17] = [
    "nose",
    "left_eye",
    "right_eye",
    "left_ear",
    "right_ear",
    "left_shoulder",
    "right_shoulder",
    "left_elbow",
    "right_elbow",
    "left_wrist",
    "right_wrist",
    "left_hip",
    "right_hip",
    "left_knee",
    "right_knee",
    "left_ankle",
    "right_ankle",
];
/// In the order of `BODY_25`.
const BODY_25: [&str; 25] = [
    "nose",
    "neck",
    "right_shoulder",
    "right_elbow",
    "right_wrist",
    "left_shoulder",
    "left_elbow",
    "left_wrist",
    "hip",
    "right_hip",
    "right_knee",
    "right_ankle",
    "left_hip",
    "left_knee",
    "left_ankle",
    "right_eye",
    "left_eye",
    "right_ear",
    "left_ear",
    "left_big_toe",
    "left_small_toe",
    "left_heel",
    "right_big_toe",
    "right_small_toe",
    "right_heel",
];
const BLAZEPOSE: [&str; 33] = [
    "nose",
    "left_eye_inner",
    "left_eye",
    "left_eye_outer",
    "right_eye_inner",
    "right_eye",
    "right_eye_outer",
    "left_ear",
    "right_ear",
    "mouth_left",
    "mouth_right",
    "left_shoulder",
    "right_shoulder",
    "left_elbow",
    "right_elbow",
    "left_wrist",
    "right_wrist",
    "left_pinky",
    "right_pinky",
    "left_index",
    "right_index",
    "left_thumb",
    "right_thumb",
    "left_hip",
    "right_hip",
    "left_knee",
    "right_knee",
    "left_ankle",
    "right_ankle",
    "left_heel",
    "right_heel",
    "left_foot_index",
    "right_foot_index",
];
/// After COCO's.
const HALPE: [&str; 9] = [
    "head",
    "neck",
    "hip",
    "left_big_toe",
    "right_big_toe",
    "left_small_toe",
    "right_small_toe",
    "left_heel",
    "right_heel",
];
/// All sets, those with most points first: a set's names may be among a larger one's.
const ALL: [PointSet; 4] = [
    PointSet::Blazepose33,
    PointSet::Halpe26,
    PointSet::Body25,
    PointSet::Coco17,
];

impl PointSet {
    /// The names of its points, in its order.
    pub(super) fn names(self) -> Vec<&'static str> {
        match self {
            Self::Coco17 => COCO.to_vec(),
            Self::Body25 => BODY_25.to_vec(),
            Self::Blazepose33 => BLAZEPOSE.to_vec(),
            Self::Halpe26 => COCO.into_iter().chain(HALPE).collect(),
        }
    }

    pub(super) fn count(self) -> usize {
        self.names().len()
    }

    /// The set of `count` points.
    pub(super) fn of_count(count: usize) -> Option<Self> {
        ALL.into_iter().find(|set| set.count() == count)
    }

    /// The largest set whose points all have one of `names`.
    pub(super) fn of_names(names: &[String]) -> Option<Self> {
        let has = |name: &&str| names.iter().any(|other| other == name);
        let all = |set: &PointSet| set.names().iter().all(has);
        ALL.into_iter().find(all)
    }

    /// The set that a body is fitted to, and where each of its points is in this one.
    pub(super) fn fitted(self) -> (KeyPointSet, Vec<usize>) {
        let same = |set: KeyPointSet| (set, (0..set.points()).collect());
        match self {
            Self::Coco17 => same(KeyPointSet::Coco17),
            Self::Body25 => same(KeyPointSet::OpenPose25),
            Self::Blazepose33 => same(KeyPointSet::BlazePose33),
            Self::Halpe26 => {
                let names = self.names();
                let at = |wanted: &&str| names.iter().position(|name| name == wanted);
                (
                    KeyPointSet::OpenPose25,
                    BODY_25.iter().filter_map(at).collect(),
                )
            }
        }
    }

    /// The name that `--points` takes.
    pub(super) fn word(self) -> &'static str {
        match self {
            Self::Coco17 => "coco17",
            Self::Body25 => "body25",
            Self::Blazepose33 => "blazepose33",
            Self::Halpe26 => "halpe26",
        }
    }
}

/// A point's name with underscores and in lower case, for names such as `leftEye`, `left_big toe` or `LEFT_EYE`.
pub(super) fn plain(name: &str) -> String {
    let mut plain = String::with_capacity(name.len() + 4);
    let mut before_lower = false;
    for letter in name.trim().chars() {
        if letter.is_ascii_uppercase() && before_lower {
            plain.push('_');
        }
        before_lower = letter.is_ascii_lowercase();
        plain.push(match letter {
            ' ' | '-' => '_',
            letter => letter.to_ascii_lowercase(),
        });
    }
    plain
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_is_told_by_its_count_and_by_its_names() {
        for set in ALL {
            assert_eq!(PointSet::of_count(set.count()), Some(set));
            let names: Vec<String> = set.names().iter().map(|name| plain(name)).collect();
            assert_eq!(PointSet::of_names(&names), Some(set));
            let (fitted, order) = set.fitted();
            assert_eq!(order.len(), fitted.points());
        }
        assert_eq!(PointSet::of_count(18), None);
        assert_eq!(plain("leftEye"), "left_eye");
        assert_eq!(plain("LEFT_BIG TOE"), "left_big_toe");
        let (_, order) = PointSet::Halpe26.fitted();
        let names = PointSet::Halpe26.names();
        let found: Vec<&str> = order.iter().map(|at| names[*at]).collect();
        assert_eq!(found, BODY_25);
    }
}
