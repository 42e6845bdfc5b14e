//! Key points of one person in the pictures of one camera.

use crate::markers::Markers;

/// The body points of a detector, in its order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KeyPointSet {
    /// The 33 landmarks of BlazePose (MediaPipe).
    BlazePose33,
    /// The 17 key points of COCO: nose, eyes, ears, shoulders, elbows, wrists, hips, knees,
    /// ankles; left before right.
    Coco17,
    /// COCO's 17, then the first knuckles of the little fingers and of the index fingers, and the second joints of the
    /// thumbs; left before right.
    Coco17Hands,
    /// The 25 points of OpenPose's `BODY_25`.
    OpenPose25,
    /// `BODY_25`, then six points of the hands as in [`Self::Coco17Hands`].
    OpenPose25Hands,
    /// The 24 joints of SMPL's tree.
    Joints24,
}

impl KeyPointSet {
    /// Points per frame.
    pub fn points(self) -> usize {
        match self {
            Self::BlazePose33 => 33,
            Self::Coco17 => 17,
            Self::Coco17Hands => 23,
            Self::OpenPose25 => 25,
            Self::OpenPose25Hands => 31,
            Self::Joints24 => 24,
        }
    }

    /// Each point's counterpart on the body's other side; a point in the middle is its own.
    pub fn other_sides(self) -> Vec<usize> {
        Markers::of(self).mirror
    }
}

/// Key points of one frame.
#[derive(Clone, Debug, Default)]
pub struct FrameKeyPoints {
    /// The frame's number.
    pub index: u32,
    /// `[N, 3]`: x and y in pixels from the picture's corner, and confidence from 0 to 1. Unseen points
    /// have confidence 0.
    pub picture: Vec<[f64; 3]>,
    /// `[N, 3]`, metres from any origin, in the camera's axes (x right, y down, z forward), if the
    /// detector guesses depth. Empty otherwise.
    pub space: Vec<[f64; 3]>,
    /// Left and right hand, as a detector of hands sees them, if it does.
    pub hands: [Option<HandPoints>; 2],
    /// The face, as a detector of faces sees it, if it does.
    pub face: Option<FacePoints>,
    /// Colours of the body's patches ([`patches`](crate::patches)), 0 to 1; empty without the pictures.
    pub colours: Vec<[f64; 3]>,
}

/// Points of one hand: the wrist, then four from the palm to the tip of thumb, index, middle, ring and little finger.
#[derive(Clone, Debug)]
pub struct HandPoints {
    /// x and y in pixels from the picture's corner.
    pub picture: [[f64; 2]; 21],
    /// Metres from any origin, in the camera's axes.
    pub space: [[f64; 3]; 21],
    /// From 0 to 1.
    pub confidence: f64,
}

/// Points of a face: nose, then inner corner, middle and outer corner of the left eye and of the right eye, then left and right corner of
/// the mouth.
#[derive(Clone, Debug)]
pub struct FacePoints {
    /// x, y and z in pixels: x and y from the picture's corner, z away from the camera from any origin.
    pub picture: [[f64; 3]; 9],
    /// The middle of the upper lip's lower edge, and that of the lower lip's upper edge, as `picture`.
    pub lips: [[f64; 3]; 2],
    /// The middles of the edges of the upper and the lower eyelid, of the left and the right eye, as `picture`.
    pub eyelids: [[[f64; 3]; 2]; 2],
    /// From 0 to 1.
    pub confidence: f64,
}

/// Landmarks of MediaPipe's face mesh whose mean is one of [`FacePoints::picture`], in its order: an eye's middle is between its lids.
const OF_MESH: [[usize; 2]; 9] = [
    [1, 1],
    [362, 362],
    [386, 374],
    [263, 263],
    [133, 133],
    [159, 145],
    [33, 33],
    [291, 291],
    [61, 61],
];
/// Its landmarks at the lips' edges, and at those of the left and the right eye's lids.
const LIPS: [usize; 2] = [13, 14];
const EYELIDS: [[usize; 2]; 2] = [[386, 374], [159, 145]];

impl FacePoints {
    /// Landmarks of a face by MediaPipe's mesh.
    pub const MESH: usize = 468;

    /// The points of a face by the landmarks of MediaPipe's mesh, [`Self::MESH`] or more, as [`Self::picture`]; `None` if there are fewer.
    pub fn of_mesh(landmarks: &[[f64; 3]], confidence: f64) -> Option<Self> {
        let at = |index: usize| landmarks.get(index).copied();
        let pair = |[a, b]: [usize; 2]| Some([at(a)?, at(b)?]);
        let mut picture = [[0.0; 3]; 9];
        for (point, ends) in picture.iter_mut().zip(OF_MESH) {
            let [a, b] = pair(ends)?;
            *point = std::array::from_fn(|axis| 0.5 * (a[axis] + b[axis]));
        }
        Some(Self {
            picture,
            lips: pair(LIPS)?,
            eyelids: [pair(EYELIDS[0])?, pair(EYELIDS[1])?],
            confidence,
        })
    }
}

/// Key points of one person in a clip.
#[derive(Clone, Debug)]
pub struct KeyPoints {
    /// The meaning of the points.
    pub set: KeyPointSet,
    /// Width and height of the pictures, pixels.
    pub image_size: [u32; 2],
    /// Frames per second.
    pub fps: f64,
    /// The frames that show the person, with ascending indices.
    pub frames: Vec<FrameKeyPoints>,
}
