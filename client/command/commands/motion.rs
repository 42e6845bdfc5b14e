//! `yoto motion`: the contents of a motion file, and the joints that it moves.

use super::table;
use anyhow::Context;
use clap::Args;
use std::path::{Path, PathBuf};
use yoto_import::motion::{DEFAULT_JOINT_MAP, Motion, MotionOptions, Up, read};
use yoto_terminal::output;
use yoto_terminal::progress::count;

const AFTER_HELP: &str = "\
A joint map is JSON: each joint of a person with the names that motions have for it, e.g.
  {\"l_knee\": [\"LeftLeg\", \"LeftKnee\"], …}

Examples:
  yoto motion walk.bvh
  yoto motion walk.bvh --write-map joints.json    # edit it, then:
  yoto motion walk.bvh --joint-map joints.json
  yoto render duo --subject bob --motion-file walk.bvh --joint-map joints.json --out out/walk";

/// Show the contents of a motion file and the joints of a person that it moves.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(super) struct MotionCommand {
    /// BVH, AMASS-style .npz, or a pose track (.json, .pb).
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Write the default joint map to a file, for editing.
    #[arg(long, value_name = "FILE")]
    write_map: Option<PathBuf>,
    #[command(flatten)]
    reading: MotionArgs,
}

/// Options for reading a motion file.
#[derive(Debug, Args)]
pub(super) struct MotionArgs {
    /// Joint names of BVH files, as JSON; `yoto motion --write-map` writes one to edit.
    #[arg(long, value_name = "FILE")]
    joint_map: Option<PathBuf>,
    /// Your copy of SMPL's body model (.npz or .pkl), for the legs' length in .npz motions.
    #[arg(long, value_name = "FILE", env = "YOTO_SMPL")]
    smpl: Option<PathBuf>,
    /// Up axis of a motion file [default: z for AMASS's files; y for others, or z for a BVH file
    /// whose spine is upright only then].
    #[arg(long, value_name = "AXIS")]
    up: Option<Up>,
    /// Move the joints that have the names of a BVH file's own, in place of SMPL's: for people whose captures
    /// keep that skeleton.
    #[arg(long)]
    keep_skeleton: bool,
}

impl MotionArgs {
    /// Whether any option was given; a body model may come from the environment, for all commands.
    pub(super) fn any(&self) -> bool {
        self.joint_map.is_some() || self.up.is_some() || self.keep_skeleton
    }

    /// No options.
    #[cfg(test)]
    pub(super) fn none() -> Self {
        Self {
            joint_map: None,
            smpl: None,
            up: None,
            keep_skeleton: false,
        }
    }

    /// Options of a joint map, and of whose joints a BVH file moves.
    #[cfg(feature = "embedded")]
    pub(super) fn of_joints(joint_map: Option<PathBuf>, keep_skeleton: bool) -> Self {
        Self {
            joint_map,
            smpl: None,
            up: None,
            keep_skeleton,
        }
    }

    /// Reads a motion and prints its assumptions.
    pub(super) fn read(&self, file: &Path) -> anyhow::Result<Motion> {
        let options = MotionOptions {
            joint_map: self.joint_map.clone(),
            body_model: self.smpl.clone(),
            up: self.up,
            keep_skeleton: self.keep_skeleton,
        };
        let motion = read(file, &options)?;
        for note in &motion.notes {
            tell!("note: {note}");
        }
        Ok(motion)
    }
}

impl MotionCommand {
    pub(super) fn run(self) -> anyhow::Result<()> {
        if let Some(path) = &self.write_map {
            std::fs::write(path, DEFAULT_JOINT_MAP)
                .with_context(|| format!("writing {}", path.display()))?;
            tell!("wrote {}", path.display());
        }
        let motion = self.reading.read(&self.file)?;
        say!(
            "{} at {:.2} per second: {:.1} s",
            count(motion.frames.len(), "frame"),
            motion.fps,
            motion.frames.len() as f64 / motion.fps
        );
        output::put("frames", motion.frames.len());
        output::put("fps", motion.fps);
        let moved = motion
            .matched
            .iter()
            .map(|(joint, name)| (joint.clone(), name.clone().into()));
        output::put("moved_by", moved.collect::<serde_json::Map<_, _>>());
        output::put("moving_nothing", motion.unmatched.clone());
        let row = |(joint, name): &(String, String)| vec![joint.clone(), name.clone()];
        let rows: Vec<Vec<String>> = motion.matched.iter().map(row).collect();
        say!("{}", table::table(&["JOINT", "MOVED BY"], &rows));
        if !motion.unmatched.is_empty() {
            say!("moving nothing: {}", motion.unmatched.join(", "));
        }
        Ok(())
    }
}
