//! The positions of key points on the body: a joint for each, and an offset that the fit learns.

use crate::KeyPointSet;
use crate::lift::COUNT as PLACES;
use yoto_capture::skeleton::Vec3;

/// The attachment of a kind of key point to the body, shared by both sides.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Attachment {
    /// Offset from the joint on the left side, metres in T-pose.
    pub offset: Vec3,
    /// Standard deviation of each component of the offset between people and detectors, metres; 0 keeps the
    /// component fixed.
    pub spread: Vec3,
}

/// A key point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Marker {
    pub joint: usize,
    /// Index of its [`Attachment`] in [`Markers::attachments`].
    pub attachment: usize,
    /// 1 on the left or in the middle, -1 on the right: the sign of the offset's x.
    pub side: f64,
}

/// The key points of a set.
#[derive(Clone, Debug)]
pub(crate) struct Markers {
    pub markers: Vec<Marker>,
    pub attachments: Vec<Attachment>,
    /// Pairs of points that give a direction in space.
    pub bones: Vec<[usize; 2]>,
    /// Each point's counterpart on the other side; a point in the middle is its own.
    pub mirror: Vec<usize>,
    /// The points of the soles; empty in sets that have none.
    pub soles: Vec<usize>,
    /// Wrist, thumb, index and little finger of the left and of the right hand; `None` in sets without fingers.
    pub hands: [Option<[usize; 4]>; 2],
    /// The points of a face in the order of [`FacePoints`](crate::FacePoints); `None` in sets that lack one of them.
    pub face: Option<[usize; 9]>,
    /// The points whose depth the network finds, in its order.
    pub places: [Option<usize>; PLACES],
    /// The points for the first guess.
    pub figure: FirstGuessPoints,
}

/// Indices of the points that a first guess needs, left before right; `None` for points that a set lacks.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FirstGuessPoints {
    pub shoulders: [usize; 2],
    pub elbows: [usize; 2],
    pub wrists: [usize; 2],
    pub hips: [usize; 2],
    pub knees: [usize; 2],
    pub ankles: [usize; 2],
    pub toes: Option<[usize; 2]>,
    pub ears: Option<[usize; 2]>,
    pub nose: Option<usize>,
}

/// The kinds of key points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum MarkerKind {
    Nose,
    EyeInner,
    Eye,
    EyeOuter,
    Ear,
    Mouth,
    Neck,
    MidHip,
    Shoulder,
    Elbow,
    Wrist,
    Pinky,
    Index,
    Thumb,
    Hip,
    Knee,
    Ankle,
    Heel,
    BigToe,
    SmallToe,
    FootIndex,
    /// A joint of the tree itself.
    Joint(usize),
}

use MarkerKind::{
    Ankle, BigToe, Ear, Elbow, Eye, EyeInner, EyeOuter, FootIndex, Heel, Hip, Index, Knee, MidHip,
    Mouth, Neck, Nose, Pinky, Shoulder, SmallToe, Thumb, Wrist,
};

impl MarkerKind {
    /// Joint on the left side, offset and spread.
    fn attachment(self) -> (usize, Vec3, Vec3) {
        let middle = [0.0, 0.02, 0.02];
        let any = [0.012, 0.02, 0.02];
        let joint = [0.012; 3];
        match self {
            Nose => (15, [0.0, 0.06, 0.12], middle),
            EyeInner => (15, [0.017, 0.095, 0.095], any),
            Eye => (15, [0.032, 0.095, 0.09], any),
            EyeOuter => (15, [0.045, 0.095, 0.08], any),
            Ear => (15, [0.075, 0.07, 0.0], any),
            Mouth => (15, [0.025, 0.025, 0.095], any),
            Neck => (12, [0.0, -0.04, 0.0], middle),
            MidHip => (0, [0.0, -0.02, 0.0], [0.0, 0.02, 0.015]),
            Shoulder => (16, [0.0; 3], [0.015; 3]),
            Elbow => (18, [0.0; 3], joint),
            Wrist => (20, [0.0; 3], joint),
            Pinky => (20, [0.08, -0.005, -0.03], any),
            Index => (20, [0.09, 0.0, 0.025], any),
            Thumb => (20, [0.045, -0.01, 0.045], any),
            Hip => (1, [0.01, 0.02, 0.0], [0.02, 0.025, 0.015]),
            Knee => (4, [0.0; 3], joint),
            Ankle => (7, [0.0; 3], joint),
            Heel => (7, [0.0, -0.055, -0.04], any),
            BigToe => (7, [-0.02, -0.06, 0.185], any),
            SmallToe => (7, [0.05, -0.06, 0.15], any),
            FootIndex => (7, [0.005, -0.06, 0.165], any),
            Self::Joint(joint) => (joint, [0.0; 3], [0.0; 3]),
        }
    }
}

/// Pairs of kinds with a direction along the body.
const BONES: [(MarkerKind, MarkerKind); 13] = [
    (Hip, Knee),
    (Knee, Ankle),
    (Ankle, FootIndex),
    (Heel, FootIndex),
    (Heel, BigToe),
    (Hip, Shoulder),
    (Shoulder, Elbow),
    (Elbow, Wrist),
    (Wrist, Index),
    (Wrist, Pinky),
    (Pinky, Index),
    (Ear, Nose),
    (Shoulder, Ear),
];
/// Kinds with a direction from right to left.
const ACROSS: [MarkerKind; 4] = [Hip, Shoulder, Ear, EyeOuter];

/// The points of a set in its order: kind, and side (1 left, -1 right, 0 middle).
fn table(set: KeyPointSet) -> Vec<(MarkerKind, i8)> {
    let both = |kinds: &[MarkerKind]| -> Vec<(MarkerKind, i8)> {
        kinds
            .iter()
            .flat_map(|&kind| [(kind, 1), (kind, -1)])
            .collect()
    };
    let row = |kinds: &[MarkerKind], side: i8| kinds.iter().map(|&kind| (kind, side)).collect();
    let hands = || both(&[Pinky, Index, Thumb]);
    match set {
        KeyPointSet::Coco17Hands => [table(KeyPointSet::Coco17), hands()].concat(),
        KeyPointSet::OpenPose25Hands => [table(KeyPointSet::OpenPose25), hands()].concat(),
        KeyPointSet::BlazePose33 => [
            vec![(Nose, 0)],
            row(&[EyeInner, Eye, EyeOuter], 1),
            row(&[EyeInner, Eye, EyeOuter], -1),
            both(&[Ear, Mouth, Shoulder, Elbow, Wrist, Pinky, Index, Thumb]),
            both(&[Hip, Knee, Ankle, Heel, FootIndex]),
        ]
        .concat(),
        KeyPointSet::Coco17 => [
            vec![(Nose, 0)],
            both(&[Eye, Ear, Shoulder, Elbow, Wrist, Hip, Knee, Ankle]),
        ]
        .concat(),
        KeyPointSet::OpenPose25 => [
            vec![(Nose, 0), (Neck, 0)],
            row(&[Shoulder, Elbow, Wrist], -1),
            row(&[Shoulder, Elbow, Wrist], 1),
            vec![(MidHip, 0)],
            row(&[Hip, Knee, Ankle], -1),
            row(&[Hip, Knee, Ankle], 1),
            vec![(Eye, -1), (Eye, 1), (Ear, -1), (Ear, 1)],
            row(&[BigToe, SmallToe, Heel], 1),
            row(&[BigToe, SmallToe, Heel], -1),
        ]
        .concat(),
        KeyPointSet::Joints24 => (0..24).map(|joint| (MarkerKind::Joint(joint), 0)).collect(),
    }
}

impl Markers {
    /// The markers of a set.
    pub(crate) fn of(set: KeyPointSet) -> Self {
        let table = table(set);
        let mut kinds: Vec<MarkerKind> = Vec::new();
        let mut attachments = Vec::new();
        let mut markers = Vec::with_capacity(table.len());
        for &(kind, side) in &table {
            let (left, offset, spread) = kind.attachment();
            let attachment = kinds.iter().position(|&known| known == kind);
            let attachment = attachment.unwrap_or_else(|| {
                kinds.push(kind);
                attachments.push(Attachment { offset, spread });
                attachments.len() - 1
            });
            // A right joint follows its left one in the tree.
            let paired = !matches!(left, 0 | 12 | 15);
            markers.push(Marker {
                joint: left + usize::from(side < 0 && paired),
                attachment,
                side: if side < 0 { -1.0 } else { 1.0 },
            });
        }
        Self {
            markers,
            attachments,
            bones: bones(&table),
            mirror: mirror(&table),
            soles: soles(&table),
            hands: hands(&table),
            face: face(&table),
            places: places(&table),
            figure: figure(&table),
        }
    }
}

fn bones(table: &[(MarkerKind, i8)]) -> Vec<[usize; 2]> {
    if table
        .iter()
        .any(|(kind, _)| matches!(kind, MarkerKind::Joint(_)))
    {
        let tree = (1..table.len()).map(|joint| [crate::skeleton::parent(joint), joint]);
        return tree.chain([[2, 1], [17, 16], [1, 16], [2, 17]]).collect();
    }
    let find = |kind: MarkerKind, side: i8| table.iter().position(|&point| point == (kind, side));
    let along = BONES.iter().flat_map(|&(from, to)| {
        [1, -1].map(|side| {
            let end = find(to, side).or_else(|| find(to, 0));
            Some([find(from, side)?, end?])
        })
    });
    let across = ACROSS
        .iter()
        .map(|&kind| Some([find(kind, -1)?, find(kind, 1)?]));
    along.chain(across).flatten().collect()
}

fn mirror(table: &[(MarkerKind, i8)]) -> Vec<usize> {
    let other = |&(kind, side): &(MarkerKind, i8)| match kind {
        MarkerKind::Joint(joint) => Some(crate::skeleton::other_side(joint)),
        _ => table.iter().position(|&point| point == (kind, -side)),
    };
    table
        .iter()
        .enumerate()
        .map(|(at, point)| other(point).unwrap_or(at))
        .collect()
}

fn soles(table: &[(MarkerKind, i8)]) -> Vec<usize> {
    let points = table.iter().enumerate();
    let soles =
        points.filter(|(_, (kind, _))| matches!(kind, Heel | BigToe | SmallToe | FootIndex));
    soles.map(|(point, _)| point).collect()
}

fn hands(table: &[(MarkerKind, i8)]) -> [Option<[usize; 4]>; 2] {
    let find = |kind: MarkerKind, side: i8| table.iter().position(|&point| point == (kind, side));
    [1, -1].map(|side| {
        let [wrist, thumb, index, pinky] =
            [Wrist, Thumb, Index, Pinky].map(|kind| find(kind, side));
        Some([wrist?, thumb?, index?, pinky?])
    })
}

fn face(table: &[(MarkerKind, i8)]) -> Option<[usize; 9]> {
    let find = |point: (MarkerKind, i8)| table.iter().position(|it| *it == point);
    let eye = |side| [EyeInner, Eye, EyeOuter].map(|kind| find((kind, side)));
    let [[a, b, c], [d, e, f]] = [eye(1), eye(-1)];
    let [left, right] = [1, -1].map(|side| find((Mouth, side)));
    Some([find((Nose, 0))?, a?, b?, c?, d?, e?, f?, left?, right?])
}

fn places(table: &[(MarkerKind, i8)]) -> [Option<usize>; PLACES] {
    let find = |kind: MarkerKind, joint: Option<usize>, side: i8| {
        let joint = joint.map(|left| MarkerKind::Joint(left + usize::from(side < 0)));
        let is_it = |point: &(MarkerKind, i8)| *point == (kind, side) || Some(point.0) == joint;
        table.iter().position(is_it)
    };
    let toe = |side| find(FootIndex, None, side).or_else(|| find(BigToe, None, side));
    let mut places = [None; PLACES];
    places[0] = find(Nose, None, 0);
    let pairs = [
        (Ear, None),
        (Shoulder, Some(16)),
        (Elbow, Some(18)),
        (Wrist, Some(20)),
        (Index, None),
        (Hip, Some(1)),
        (Knee, Some(4)),
        (Ankle, Some(7)),
        (Heel, None),
    ];
    for (at, (kind, joint)) in pairs.into_iter().enumerate() {
        places[2 * at + 1] = find(kind, joint, 1);
        places[2 * at + 2] = find(kind, joint, -1);
    }
    places[19] = toe(1);
    places[20] = toe(-1);
    places
}

fn figure(table: &[(MarkerKind, i8)]) -> FirstGuessPoints {
    let find = |kind: MarkerKind, joint: usize, side: i8| {
        table
            .iter()
            .position(|&point| point == (kind, side) || point.0 == MarkerKind::Joint(joint))
    };
    let pair = |kind, left: usize| Some([find(kind, left, 1)?, find(kind, left + 1, -1)?]);
    let sure = |kind, left| pair(kind, left).unwrap_or_default();
    // The joint tree has no ears and no nose, so no joint must match; `pair` adds 1, hence the -1.
    let none = usize::MAX - 1;
    FirstGuessPoints {
        shoulders: sure(Shoulder, 16),
        elbows: sure(Elbow, 18),
        wrists: sure(Wrist, 20),
        hips: sure(Hip, 1),
        knees: sure(Knee, 4),
        ankles: sure(Ankle, 7),
        toes: pair(FootIndex, 10).or_else(|| pair(BigToe, 10)),
        ears: pair(Ear, none),
        nose: find(Nose, none, 0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_set_has_its_points() {
        for set in [
            KeyPointSet::BlazePose33,
            KeyPointSet::Coco17,
            KeyPointSet::Coco17Hands,
            KeyPointSet::OpenPose25,
            KeyPointSet::OpenPose25Hands,
            KeyPointSet::Joints24,
        ] {
            let markers = Markers::of(set);
            assert_eq!(markers.markers.len(), set.points(), "{set:?}");
            let figure = markers.figure;
            let joints = |points: [usize; 2]| points.map(|point| markers.markers[point].joint);
            assert_eq!(joints(figure.shoulders), [16, 17], "{set:?}");
            assert_eq!(joints(figure.wrists), [20, 21], "{set:?}");
            assert_eq!(joints(figure.hips), [1, 2], "{set:?}");
            assert_eq!(joints(figure.ankles), [7, 8], "{set:?}");
            for (at, &other) in markers.mirror.iter().enumerate() {
                assert_eq!(markers.mirror[other], at, "{set:?}");
                let (a, b) = (markers.markers[at], markers.markers[other]);
                assert_eq!(crate::skeleton::other_side(a.joint), b.joint, "{set:?}");
            }
        }
        let blaze = Markers::of(KeyPointSet::BlazePose33);
        assert_eq!(blaze.places, crate::lift::POINTS.map(Some));
        assert_eq!(blaze.face, Some([0, 1, 2, 3, 4, 5, 6, 9, 10]));
        assert_eq!(Markers::of(KeyPointSet::Coco17).face, None);
        let coco = Markers::of(KeyPointSet::Coco17).places;
        assert_eq!(coco[..5], [Some(0), Some(3), Some(4), Some(5), Some(6)]);
        assert_eq!(coco[15..], [Some(15), Some(16), None, None, None, None]);
        assert_eq!(blaze.figure.shoulders, [11, 12]);
        assert_eq!(blaze.figure.ankles, [27, 28]);
        assert_eq!(blaze.figure.toes, Some([31, 32]));
        assert_eq!(Markers::of(KeyPointSet::OpenPose25).figure.ankles, [14, 11]);
    }
}
