//! `yoto motion`: the contents of a motion file, and the joints that it moves.

use crate::args::motion::MotionArgs;
use crate::show;
use anyhow::Context;
use clap::Args;
use std::path::PathBuf;
use yoto_import::motion::DEFAULT_JOINT_MAP;
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
pub(crate) struct MotionCommand {
    /// BVH, AMASS-style .npz, or a pose track (.json, .pb).
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Write the default joint map to a file, for editing.
    #[arg(long, value_name = "FILE")]
    write_map: Option<PathBuf>,
    #[command(flatten)]
    reading: MotionArgs,
}

impl MotionCommand {
    pub(crate) fn run(self) -> anyhow::Result<()> {
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
        say!("{}", show::table(&["JOINT", "MOVED BY"], &rows));
        if !motion.unmatched.is_empty() {
            say!("moving nothing: {}", motion.unmatched.join(", "));
        }
        Ok(())
    }
}
