//! BVH files with the names of other rigs' joints, other axes up, and what exporters leave wrong.

use std::path::Path;
use yoto_capture::skeleton::transform::rodrigues;
use yoto_import::motion::{Motion, MotionOptions, read};

/// Frames of the made-up motion.
const FRAMES: usize = 12;
/// Parents of the made-up rig's joints: hips, spine, neck, head, left leg, right leg, left arm, right arm.
const PARENTS: [Option<usize>; 16] = [
    None,
    Some(0),
    Some(1),
    Some(2),
    Some(0),
    Some(4),
    Some(5),
    Some(0),
    Some(7),
    Some(8),
    Some(1),
    Some(10),
    Some(11),
    Some(1),
    Some(13),
    Some(14),
];
/// Offsets from the parents, centimetres, y up: a T-pose.
const OFFSETS: [[f64; 3]; 16] = [
    [0.0, 0.0, 0.0],
    [0.0, 25.0, 0.0],
    [0.0, 25.0, 0.0],
    [0.0, 10.0, 0.0],
    [10.0, -5.0, 0.0],
    [0.0, -42.0, 0.0],
    [0.0, -42.0, 0.0],
    [-10.0, -5.0, 0.0],
    [0.0, -42.0, 0.0],
    [0.0, -42.0, 0.0],
    [18.0, 20.0, 0.0],
    [28.0, 0.0, 0.0],
    [25.0, 0.0, 0.0],
    [-18.0, 20.0, 0.0],
    [-28.0, 0.0, 0.0],
    [-25.0, 0.0, 0.0],
];
const MIXAMO: [&str; 16] = [
    "Hips",
    "Spine",
    "Neck",
    "Head",
    "LeftUpLeg",
    "LeftLeg",
    "LeftFoot",
    "RightUpLeg",
    "RightLeg",
    "RightFoot",
    "LeftArm",
    "LeftForeArm",
    "LeftHand",
    "RightArm",
    "RightForeArm",
    "RightHand",
];

/// A BVH file of joints with these names, which step with the left leg. `turn` is the root's rotation about x, degrees,
/// and `place` its position.
fn bvh(names: &[&str; 16], turn: f64, place: impl Fn(usize) -> [f64; 3]) -> String {
    fn joint(names: &[&str; 16], at: usize, order: &mut Vec<usize>) -> String {
        order.push(at);
        let [x, y, z] = OFFSETS[at];
        let kind = if at == 0 { "ROOT" } else { "JOINT" };
        let places = if at == 0 {
            "6 Xposition Yposition Zposition"
        } else {
            "3"
        };
        let mut text = format!(
            "{kind} {}\n{{\nOFFSET {x} {y} {z}\nCHANNELS {places} Zrotation Xrotation Yrotation\n",
            names[at]
        );
        let below: Vec<usize> = (0..16).filter(|it| PARENTS[*it] == Some(at)).collect();
        for it in &below {
            text += &joint(names, *it, order);
        }
        if below.is_empty() {
            text += "End Site\n{\nOFFSET 0 5 0\n}\n";
        }
        text + "}\n"
    }
    let mut order = Vec::new();
    let tree = joint(names, 0, &mut order);
    let mut text = format!("HIERARCHY\n{tree}MOTION\nFrames: {FRAMES}\nFrame Time: 0.0333333\n");
    for frame in 0..FRAMES {
        let step = (frame as f64 / 3.0).sin();
        let mut row: Vec<String> = place(frame).iter().map(f64::to_string).collect();
        for at in &order {
            let bend = match at {
                0 => turn,
                4 => -60.0 * step,
                5 => 60.0 * step.abs(),
                _ => 0.0,
            };
            row.push(format!("0 {bend:.4} 0"));
        }
        text += &row.join(" ");
        text.push('\n');
    }
    text
}

fn walk(names: &[&str; 16]) -> String {
    bvh(names, 0.0, |frame| [0.0, 95.0, 4.0 * frame as f64])
}

fn found(dir: &Path, text: &str) -> Result<Motion, String> {
    let path = dir.join("walk.bvh");
    std::fs::write(&path, text).expect("writes");
    read(&path, &MotionOptions::default()).map_err(|error| error.to_string())
}

/// Rotations of the named joint in all frames.
fn rotations(motion: &Motion, joint: &str) -> Vec<[f64; 3]> {
    let at = motion.skeleton.names.iter().position(|name| name == joint);
    let at = at.unwrap_or_else(|| panic!("nothing moves {joint}"));
    motion
        .frames
        .iter()
        .map(|frame| frame.rotations[at])
        .collect()
}

#[test]
fn legs_of_every_rig_step() {
    let dir = tempfile::tempdir().expect("a folder");
    let usual = found(dir.path(), &walk(&MIXAMO)).expect("reads");
    let unity = [
        "Hips",
        "Spine",
        "Neck",
        "Head",
        "LeftUpperLeg",
        "LeftLowerLeg",
        "LeftFoot",
        "RightUpperLeg",
        "RightLowerLeg",
        "RightFoot",
        "LeftUpperArm",
        "LeftLowerArm",
        "LeftHand",
        "RightUpperArm",
        "RightLowerArm",
        "RightHand",
    ];
    let smpl = [
        "f_a_b_05_11_Pelvis",
        "f_a_b_05_11_Spine1",
        "f_a_b_05_11_Neck",
        "f_a_b_05_11_Head",
        "f_a_b_05_11_L_Hip",
        "f_a_b_05_11_L_Knee",
        "f_a_b_05_11_L_Ankle",
        "f_a_b_05_11_R_Hip",
        "f_a_b_05_11_R_Knee",
        "f_a_b_05_11_R_Ankle",
        "f_a_b_05_11_L_Shoulder",
        "f_a_b_05_11_L_Elbow",
        "f_a_b_05_11_L_Wrist",
        "f_a_b_05_11_R_Shoulder",
        "f_a_b_05_11_R_Elbow",
        "f_a_b_05_11_R_Wrist",
    ];
    let kinect = [
        "PELVIS",
        "SPINE_NAVEL",
        "NECK",
        "HEAD",
        "HIP_LEFT",
        "KNEE_LEFT",
        "ANKLE_LEFT",
        "HIP_RIGHT",
        "KNEE_RIGHT",
        "ANKLE_RIGHT",
        "SHOULDER_LEFT",
        "ELBOW_LEFT",
        "WRIST_LEFT",
        "SHOULDER_RIGHT",
        "ELBOW_RIGHT",
        "WRIST_RIGHT",
    ];
    // A root that nothing is known by: the joint above both legs and the back is the pelvis.
    let rootless = {
        let mut names = unity;
        names[0] = "Armature_Base";
        names
    };
    for names in [unity, smpl, kinect, rootless] {
        let motion = found(dir.path(), &walk(&names)).expect(names[0]);
        assert_eq!(motion.matched.len(), 16, "{:?}", motion.unmatched);
        for joint in ["l_hip", "l_knee", "r_hip"] {
            assert_eq!(
                rotations(&motion, joint),
                rotations(&usual, joint),
                "{}: {joint}",
                names[0]
            );
        }
        assert!(motion.notes.is_empty(), "{:?}", motion.notes);
    }
}

#[test]
fn limbs_that_nothing_moves_are_named() {
    let dir = tempfile::tempdir().expect("a folder");
    let mut names = MIXAMO;
    (names[4], names[5]) = ("Bein_oben", "Bein_unten");
    let notes = found(dir.path(), &walk(&names))
        .expect("reads")
        .notes
        .join("; ");
    assert!(
        notes.contains("nothing in the file moves l_hip, l_knee")
            && notes.contains("Bein_oben, Bein_unten"),
        "{notes}"
    );
}

#[test]
fn files_of_other_axes_stand_up() {
    let dir = tempfile::tempdir().expect("a folder");
    let usual = found(dir.path(), &walk(&MIXAMO)).expect("reads");
    let upright = |motion: &Motion| {
        rotations(motion, "pelvis")
            .iter()
            .all(|root| rodrigues(*root)[1][1] > 0.99)
    };
    assert!(upright(&usual));
    // y down, as of a camera, with the root turned upside down; and z up below a rest pose with y up.
    let walks = [
        (
            180.0,
            "-y is up",
            bvh(&MIXAMO, 180.0, |frame| [0.0, -95.0, -4.0 * frame as f64]),
        ),
        (
            90.0,
            "z is up",
            bvh(&MIXAMO, 90.0, |frame| {
                [3.0 * frame as f64, -4.0 * frame as f64, 95.0]
            }),
        ),
    ];
    for (turn, said, text) in walks {
        let motion = found(dir.path(), &text).unwrap_or_else(|error| panic!("{turn}: {error}"));
        let notes = motion.notes.join("; ");
        assert!(notes.contains(said), "{turn}: {notes}");
        assert!(upright(&motion), "{turn}: {notes}");
        let pairs = rotations(&motion, "l_knee");
        for (found, wanted) in pairs.iter().zip(rotations(&usual, "l_knee")) {
            let off = (0..3).map(|axis| (found[axis] - wanted[axis]).abs());
            assert!(off.fold(0.0, f64::max) < 1e-9, "{found:?} {wanted:?}");
        }
    }
}

#[test]
fn frames_that_are_there_are_read() {
    let dir = tempfile::tempdir().expect("a folder");
    let text = walk(&MIXAMO);
    let whole = found(dir.path(), &text).expect("reads");
    for (counted, said) in [
        ("Frames: 11", "counts 11 frames"),
        ("Frames: 22", "counts 22 frames"),
    ] {
        let motion = found(dir.path(), &text.replace("Frames: 12", counted)).expect(said);
        assert_eq!(motion.frames, whole.frames);
        assert!(motion.notes.join("; ").contains(said), "{:?}", motion.notes);
    }
    let cut = &text[..text.len() - 40];
    let motion = found(dir.path(), cut).expect("all but the last frame");
    assert_eq!(motion.frames, whole.frames[..FRAMES - 1]);
    assert!(
        motion.notes.join("; ").contains("ends within frame 11"),
        "{:?}",
        motion.notes
    );
    let marked = format!(
        "\u{feff}{}",
        text.replace("End Site", "end site").replace('\n', "\r\n")
    );
    assert_eq!(
        found(dir.path(), &marked).expect("reads").frames,
        whole.frames
    );
    // A writer's NaN in the left knee of one frame.
    let frame = text.lines().count() - 5;
    let spoiled: Vec<String> = text
        .lines()
        .enumerate()
        .map(|(at, line)| {
            let mut cells: Vec<&str> = line.split(' ').collect();
            if at == frame {
                // Six of the root, nine joints of the back and the arms, the hip, then the knee's second.
                cells[6 + 3 * (9 + 1) + 1] = "nan";
            }
            cells.join(" ")
        })
        .collect();
    let motion = found(dir.path(), &spoiled.join("\n")).expect("reads");
    let notes = motion.notes.join("; ");
    assert!(
        notes.contains("1 of 12 frames") && notes.contains("7 (rotation of l_knee)"),
        "{notes}"
    );
    assert_eq!(motion.frames.len(), FRAMES);
    let off = |at: usize| (motion.frames[at].root[2] - whole.frames[at].root[2]).abs();
    assert!(
        (0..FRAMES).all(|at| off(at) < 1e-3),
        "the motion takes its time"
    );
}
