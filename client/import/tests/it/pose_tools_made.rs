//! Files of pose tools made up from what the script of the captures says, for tests of wrong and strange ones.

use crate::pickled;
use crate::pose_tools::{files, off, truth};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use yoto_import::{Format, Imported, Options, read};

pub(crate) fn refused(clip: &Path, options: &Options) -> String {
    let done = read(Format::AUTO, clip, options);
    done.map(|found| found.notes)
        .expect_err("refused")
        .to_string()
}

/// WHAM's file of the first person, changed.
pub(crate) fn wham(dir: &Path, frames: &[usize], change: impl Fn(&mut Value)) -> PathBuf {
    let body = &truth().people[0];
    let of = |frame: &usize| (body.poses[*frame].clone(), body.t[*frame]);
    let (poses, t): (Vec<Vec<f64>>, Vec<[f64; 3]>) = frames.iter().map(of).unzip();
    let numbers: Vec<usize> = (0..frames.len()).collect();
    let mut person =
        json!({"pose": poses, "trans": t, "betas": [vec![0.0; 10]], "frame_ids": numbers});
    change(&mut person);
    let path = dir.join("wham_output.pkl");
    pickled::write(&path, &json!({ "0": person }));
    path
}

pub(crate) fn all() -> Vec<usize> {
    (0..16).collect()
}

pub(crate) fn lands(found: &Imported) {
    let truth = truth();
    let off = off(&found.track, |frame| truth.people[0].pixels[frame].clone());
    assert!(off < 0.5, "{off:.2} px; {:?}", found.notes);
}

/// LHM's files with each changed.
pub(crate) fn lhm(dir: &Path, change: impl Fn(&mut Value)) -> PathBuf {
    let folder = dir.join("smplx_params");
    std::fs::create_dir_all(&folder).expect("a folder");
    for number in 1..=16 {
        let name = format!("{number:05}.json");
        let text = std::fs::read(files("lhm/smplx_params").join(&name)).expect("a file");
        let mut frame = serde_json::from_slice(&text).expect("JSON");
        change(&mut frame);
        std::fs::write(folder.join(name), frame.to_string()).expect("writes");
    }
    folder
}

/// A clip of every fourth frame, in which a frame is a large step.
pub(crate) fn steps(dir: &Path) -> PathBuf {
    let clip = dir.join("clip");
    for (folder, digits) in [("frames", 6), ("masks", 5)] {
        std::fs::create_dir_all(clip.join(folder)).expect("a folder");
        for at in 0..4 {
            let from = files(&format!("clip/{folder}/{:0digits$}.png", 4 * at));
            std::fs::copy(from, clip.join(format!("{folder}/{at:06}.png"))).expect("copies");
        }
    }
    clip
}
