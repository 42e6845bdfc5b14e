//! Motions to learn from.

use anyhow::{Context, ensure};
use std::path::{Path, PathBuf};
use yoto_capture::skeleton::Vec3;
use yoto_capture::skeleton::smpl::AVERAGE_REST;
use yoto_capture::skeleton::transform::{rodrigues, scale};
use yoto_import::motion::{Motion, MotionOptions};
use yoto_import::read_motion;
use yoto_pose::lift::learn::{ClipFrame, MotionClip};
use yoto_proto::smpl::JOINTS;

/// Frames per second that are enough.
const FPS: f64 = 30.0;
/// Most seconds of one clip, so that a long one does not outweigh the others.
const SECONDS: f64 = 45.0;
const ANKLE: usize = 7;

/// Reads the motions below `folders` in the order of their paths.
///
/// # Errors
/// The first file that can't be read, or a folder without motions.
pub fn read_motions(folders: &[PathBuf]) -> anyhow::Result<Vec<MotionClip>> {
    let mut paths = Vec::new();
    for folder in folders {
        let before = paths.len();
        collect(folder, &mut paths)?;
        ensure!(
            paths.len() > before,
            "{}: no motions (.bvh or .npz) there",
            folder.display()
        );
    }
    paths.sort();
    paths.iter().map(|path| clip(path)).collect()
}

fn collect(folder: &Path, paths: &mut Vec<PathBuf>) -> anyhow::Result<()> {
    let reading = || format!("reading {}", folder.display());
    for entry in std::fs::read_dir(folder).with_context(reading)? {
        let path = entry.with_context(reading)?.path();
        let ending = path.extension().and_then(|it| it.to_str());
        if path.is_dir() {
            collect(&path, paths)?;
        } else if matches!(ending, Some("bvh" | "npz")) {
            paths.push(path);
        }
    }
    Ok(())
}

fn clip(path: &Path) -> anyhow::Result<MotionClip> {
    let motion = read_motion(path, &MotionOptions::default())
        .with_context(|| format!("the motion {}", path.display()))?;
    let step = ((motion.fps / FPS).round() as usize).max(1);
    let most = (SECONDS * FPS) as usize;
    let grown = metres(&motion);
    let places = JOINTS.map(|(name, _)| motion.skeleton.names.iter().position(|it| it == name));
    // Many files begin with a rest pose.
    let frames = motion.frames.iter().skip(1).step_by(step).take(most);
    let frames = frames.map(|frame| ClipFrame {
        rotations: places.map(|place| {
            let rotation = place.and_then(|it| frame.rotations.get(it)).copied();
            rodrigues(rotation.unwrap_or_default())
        }),
        root: scale(frame.root, grown),
    });
    Ok(MotionClip {
        fps: motion.fps / step as f64,
        frames: frames.collect(),
    })
}

/// The factor from a motion's lengths to those of an average body: by the height of its root above the ankles, or by that of its
/// first frame above the floor.
fn metres(motion: &Motion) -> f64 {
    let drop =
        |rest: &[Vec3], root: usize, ankle: usize| Some(rest.get(root)?[1] - rest.get(ankle)?[1]);
    let usual = drop(&AVERAGE_REST, 0, ANKLE).unwrap_or(1.0);
    let ankle = motion
        .skeleton
        .names
        .iter()
        .position(|it| it == JOINTS[ANKLE].0);
    let own = ankle.and_then(|ankle| drop(&motion.skeleton.rest_joints, 0, ankle));
    own.filter(|own| *own > 0.0).map_or(1.0, |own| usual / own)
}
