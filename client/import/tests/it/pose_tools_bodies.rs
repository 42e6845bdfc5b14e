//! Skeletons for the poses of tools: body models, joints in the tool's files, an average adult.

use crate::pose_tools::{TOOLS, files, import, off, options, truth};
use serde_json::json;
use std::path::{Path, PathBuf};
use yoto_import::{Imported, Options};

#[test]
fn posed_joints_measure_the_skeleton_and_nothing_gives_an_average_one() {
    let dir = tempfile::tempdir().expect("a folder");
    let truth = truth();
    for (name, path, closest) in [("romp", "romp", 0.5), ("phalp", TOOLS[0].1, 2.0)] {
        let measured = Options {
            rest_joints: None,
            ..options(dir.path(), files(path))
        };
        let found = import(&measured);
        let notes = found.notes.join("\n");
        assert!(
            notes.contains("measured from the joints"),
            "{name}: {notes}"
        );
        let pixels = truth.tools[name].people[0].pixels.clone().expect("pixels");
        let off = off(&found.track, |frame| pixels[frame].clone());
        assert!(off < closest, "{name}: {off:.2} px");
    }
    let average = Options {
        rest_joints: None,
        ..options(dir.path(), files(TOOLS[1].1))
    };
    let found = import(&average);
    let notes = found.notes.join("\n");
    assert!(
        notes.contains("average adult's") && notes.contains("agrees best"),
        "{notes}"
    );
    let off = off(&found.track, |frame| truth.people[0].pixels[frame].clone());
    assert!(off < 6.0, "{off:.2} px; {notes}");
    let tall = Options {
        height: Some(1.9),
        ..average.clone()
    };
    let higher = |found: &Imported| found.track.skeleton.rest_joints[12][1];
    assert!(higher(&import(&tall)) > higher(&found) + 0.02);
}

/// A body model of SMPL-X with a vertex for each of its 55 joints, the script's where SMPL has them.
fn smplx(dir: &Path) -> PathBuf {
    let rest = truth().rest_joints;
    let position = |joint: usize| match joint {
        0..22 => rest[joint],
        28 => rest[22],
        43 => rest[23],
        other => [9.0, 9.0, other as f64],
    };
    let vertices: Vec<[f64; 3]> = (0..55).map(position).collect();
    let row = |joint: usize| (0..55).map(|at| f64::from(u8::from(at == joint))).collect();
    let regressor: Vec<Vec<f64>> = (0..55).map(row).collect();
    let path = dir.join("SMPLX_NEUTRAL.pkl");
    let model = json!({"v_template": vertices, "J_regressor": regressor,
        "shapedirs": vec![vec![vec![0.0; 10]; 3]; 55]});
    crate::pickled::write(&path, &model);
    path
}

#[test]
fn tools_of_smpl_x_take_its_body_model_and_say_when_it_is_the_other() {
    let dir = tempfile::tempdir().expect("a folder");
    let truth = truth();
    let with = |model: PathBuf, path: &str| {
        import(&Options {
            rest_joints: None,
            body_model: Some(model),
            ..options(dir.path(), files(path))
        })
    };
    for tool in [2, 6, 7] {
        let found = with(smplx(dir.path()), TOOLS[tool].1);
        let off = off(&found.track, |frame| truth.people[0].pixels[frame].clone());
        let notes = found.notes.join("\n");
        assert!(off < 0.5, "{}: {off:.2} px", TOOLS[tool].0);
        assert!(!notes.contains("mean shape"), "{notes}");
    }
    let other = with(crate::captures("smpl/model.npz"), TOOLS[2].1);
    let notes = other.notes.join("\n");
    assert!(
        notes.contains("GVHMR writes shapes of SMPL-X, the body model is SMPL"),
        "{notes}"
    );
}
