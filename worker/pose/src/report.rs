//! The results of a fit, as a track and as notes for people.

use crate::KeyPoints;
use crate::forward::Posed;
use crate::height::Height;
use crate::options::FitOptions;
use crate::parameters::{ROLL, Shared, Stance};
use crate::problem::{Problem, quantile};
use crate::residuals::upright;
use crate::skeleton::{height, offsets, to_track};
use crate::solve::Guess;
use crate::world::World;
use yoto_capture::skeleton::smpl::ASSUMED_HEIGHT;
use yoto_capture::skeleton::transform::scale;
use yoto_proto::pose_track::{Frame, NO_DISTORTION, PoseTrack};

/// Least confidence of a point for the reprojection error.
const SURE: f64 = 0.3;
/// Largest reprojection error without a note, as a share of the body's extent.
const POOR: f64 = 0.015;

/// Nobody films a standing person from so steeply above, degrees.
const STEEP: f64 = 70.0;

/// A person's poses, and the other results of the fit.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// Poses of the 24 joints of SMPL's tree, of fingers if the film shows hands, and of the face if the film shows one that moves. The
    /// world has its origin in the camera, and y points down along gravity; if gravity is not estimated, the world has the camera's axes.
    pub track: PoseTrack,
    /// Median distance between detected and fitted key points in the picture, pixels.
    pub reprojection_px: f64,
    /// Focal length, pixels.
    pub focal: f64,
    /// Downward pitch of the camera, degrees, estimated from the person's uprightness.
    pub camera_down_degrees: f64,
    /// Height of the fitted body, metres.
    pub height: f64,
    /// Frames that tell how the fingers of the left and of the right hand are bent.
    pub hands: [usize; 2],
    /// Frames that tell how far mouth and eyes are open.
    pub face: usize,
    /// Assumptions and findings, for people.
    pub notes: Vec<String>,
    /// The note that says why the fit is poor, if it is.
    pub doubt: Option<String>,
}

/// The track and results of a solved fit.
pub(crate) fn fitted(
    points: &KeyPoints,
    options: &FitOptions,
    problem: &Problem,
    found: &Guess,
) -> Fitted {
    let offsets = offsets(&found.shared.factors());
    let told = match options.height {
        Some(_) => None,
        None => Height::estimate(points, problem, &found.stances, &found.shared),
    };
    let wanted = told.map_or(ASSUMED_HEIGHT, |it| it.metres);
    let wanted = options.height.unwrap_or(wanted);
    // One camera can't measure size, so bones and distances are scaled together.
    let grown = wanted / height(&offsets);
    let skeleton = to_track(&offsets.map(|offset| scale(offset, grown)));
    let focal = found.shared.focal();
    let [x, y] = problem.centre;
    let down = down(&found.stances, &found.shared);
    let steep = steep(options, down.to_degrees());
    let [tilt, roll] = if options.upright && steep.is_none() {
        [down, found.shared.values[ROLL]]
    } else {
        [0.0; 2]
    };
    let world = World::of_camera(tilt, roll);
    let rest = skeleton.rest_joints.first().copied().unwrap_or_default();
    let frames = points.frames.iter().zip(&found.stances);
    let frames = frames.map(|(frame, stance)| Frame {
        index: frame.index,
        pose: world.pose(&stance.rotations),
        translation: world.translation(rest, scale(stance.root, grown)),
        k: [[focal, 0.0, x], [0.0, focal, y], [0.0, 0.0, 1.0]],
        e: world.extrinsics(),
    });
    let reprojection_px = reprojection(problem, &found.stances, &found.shared);
    let down = down.to_degrees();
    let doubts = [doubt(problem, reprojection_px), steep]
        .into_iter()
        .flatten();
    let doubts: Vec<String> = doubts.collect();
    let doubt = (!doubts.is_empty()).then(|| doubts.join("; "));
    Fitted {
        track: PoseTrack {
            skeleton,
            image_size: points.image_size,
            fps: points.fps,
            distortion: NO_DISTORTION,
            frames: frames.collect(),
        },
        reprojection_px,
        focal,
        camera_down_degrees: down,
        height: wanted,
        hands: [0; 2],
        face: 0,
        notes: notes(
            options,
            problem,
            reprojection_px,
            doubt.as_ref(),
            [focal, down],
            told,
        ),
        doubt,
    }
}

/// Typical length of the body in pictures, pixels.
fn extent(problem: &Problem) -> f64 {
    let mut extents: Vec<f64> = problem.frames.iter().map(|frame| frame.extent).collect();
    quantile(&mut extents, 0.5)
}

/// A doubt about a camera that looks down or up by `down` degrees, so that the person stands upright in its pictures.
fn steep(options: &FitOptions, down: f64) -> Option<String> {
    (options.upright && down.abs() > STEEP).then(|| {
        let way = if down < 0.0 { "up" } else { "down" };
        format!(
            "the person would stand upright only if the camera looked {way} by {:.0}°: they lie, or the key points are nobody's. \
             The camera is taken to be level",
            down.abs()
        )
    })
}

fn doubt(problem: &Problem, reprojection: f64) -> Option<String> {
    (reprojection > POOR * extent(problem)).then(|| {
        "the fitted body is far from the key points: are they of one person throughout?".to_owned()
    })
}

fn notes(
    options: &FitOptions,
    problem: &Problem,
    reprojection: f64,
    doubt: Option<&String>,
    [focal, down]: [f64; 2],
    told: Option<Height>,
) -> Vec<String> {
    let extent = extent(problem);
    let mut notes = vec![format!(
        "poses fitted to key points: {reprojection:.1} px median error on a body of {extent:.0} px"
    )];
    notes.extend(doubt.cloned());
    if options.focal.is_none() {
        notes.push(format!(
            "focal length: {focal:.0} px, found by the fit; the camera's own is better, if it is known (--focal)"
        ));
    }
    if let Some(Height { metres, error }) = told {
        notes.push(format!(
            "height: {metres:.2} m by the distance of the eyes, give or take {error:.2} m; sizes and distances scale with it \
             (--height)"
        ));
    } else if options.height.is_none() {
        notes.push(format!(
            "height: taken to be {ASSUMED_HEIGHT} m, which one camera can't tell; sizes and distances scale with it \
             (--height)"
        ));
    }
    if !problem.has_space() {
        notes.push("no depths are given: which way limbs point was judged by their motion".into());
    }
    if options.upright && steep(options, down).is_none() {
        let way = if down < 0.0 { "up" } else { "down" };
        notes.push(format!(
            "the camera is taken to look {way} by {:.0}°, with which the person stands upright on the whole",
            down.abs()
        ));
    }
    notes
}

/// Median reprojection error of confident points, pixels.
fn reprojection(problem: &Problem, stances: &[Stance], shared: &Shared) -> f64 {
    let focal = shared.focal();
    let mut distances = Vec::new();
    for (observed, stance) in problem.frames.iter().zip(stances) {
        let posed = Posed::new(stance, shared);
        for detection in observed.detections.iter().filter(|it| it.confidence > SURE) {
            if let Some(marker) = problem.markers.markers.get(detection.marker) {
                let [x, y, z] = posed.marker(marker, shared);
                let off = [
                    focal * x / z - detection.pixel[0],
                    focal * y / z - detection.pixel[1],
                ];
                distances.push(off[0].hypot(off[1]));
            }
        }
    }
    quantile(&mut distances, 0.5)
}

/// The camera's pitch that makes the median body upright, radians.
fn down(stances: &[Stance], shared: &Shared) -> f64 {
    let lean = |stance: &Stance| {
        let way = upright::body(&Posed::new(stance, shared));
        (-way[2]).atan2(-way[1])
    };
    quantile(&mut stances.iter().map(lean).collect::<Vec<_>>(), 0.5)
}
