//! A person whose joint tree is not SMPL's, from the check to a film.

use anyhow::{Context, ensure};
use yoto_capture::skeleton::{Skeleton, transform};
use yoto_import::write_images;
use yoto_proto::pose_track::PoseTrack;
use yoto_synthetic::SyntheticPerson;
use yoto_tests::bvh::{UNTURNED, bvh};
use yoto_tests::people::write_capture;
use yoto_tests::process::{Run, Service, fail, succeed};

const YOTO: &str = env!("CARGO_BIN_EXE_yoto-under-test");
const FRAMES: usize = 48;
const SIZE: u32 = 64;
/// Joints that another program does not have.
const WITHOUT: [&str; 5] = ["spine2", "l_collar", "r_collar", "l_hand", "r_hand"];

/// `track` with 19 joints at the same positions, with names that no other program uses.
fn with_own_tree(track: &mut PoseTrack) -> anyhow::Result<()> {
    let whole = Skeleton::from_track(&track.skeleton)?;
    let names = &track.skeleton.names;
    let is_kept = |at: usize| !WITHOUT.contains(&&*names[at]);
    let kept: Vec<usize> = (0..names.len()).filter(|at| is_kept(*at)).collect();
    let above = |at: usize| {
        let parent = |at: usize| usize::try_from(track.skeleton.parents[at]).ok();
        let mut found = parent(at);
        while let Some(it) = found.filter(|it| !is_kept(*it)) {
            found = parent(it);
        }
        found
    };
    let new_index = |joint: usize| kept.iter().position(|it| *it == joint);
    let parents = kept.iter().map(|at| above(*at).and_then(new_index));
    let parents = parents.map(|parent| parent.map_or(-1, |parent| parent as i32));
    let parents = parents.collect();
    for frame in &mut track.frames {
        let (rotations, _) = frame.pose.as_chunks::<3>();
        let turned = whole.global_transforms(rotations);
        let rotation = |at: usize| turned[at].map(|row| [row[0], row[1], row[2]]);
        let local = kept.iter().map(|&at| match above(at) {
            None => transform::log_map(&rotation(at)),
            Some(above) => {
                let back = transform::transpose(&rotation(above));
                transform::log_map(&transform::matmul(&back, &rotation(at)))
            }
        });
        frame.pose = local.flatten().collect();
    }
    let rest = &track.skeleton.rest_joints;
    track.skeleton.rest_joints = kept.iter().map(|at| rest[*at]).collect();
    track.skeleton.names = kept
        .iter()
        .map(|at| format!("own {}", names[*at]))
        .collect();
    track.skeleton.parents = parents;
    Ok(())
}

#[test]
fn a_person_with_another_joint_tree_is_trained_and_rendered_as_they_are() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let cast = SyntheticPerson::cast(2, 7);
    let ada = dir.path().join("ada");
    let (mut track, images) = cast[0].capture(FRAMES, SIZE);
    with_own_tree(&mut track)?;
    write_images(&track, &images, &ada)?;
    let bruno = dir.path().join("bruno");
    write_capture(&cast[1], FRAMES, SIZE, &bruno)?;
    let [ada, bruno] = [&ada, &bruno].map(|folder| folder.to_str().unwrap_or_default());

    let said = succeed(
        YOTO,
        &["capture", "check", ada, "--out", &format!("{ada}/check")],
    )?;
    ensure!(!said.contains("fail"), "{said}");
    let service = Service::start(YOTO, &dir.path().join("data"), true)?;
    let yoto = |line: &str, run: Run| service.ask(YOTO, line, run);
    yoto(&format!("subject add ada {ada}"), succeed)?;
    yoto(&format!("subject add bruno {bruno}"), succeed)?;
    let said = yoto("train own --subjects ada --tier draft --steps 60", succeed)?;
    let decibels = said.split(" dB in the box").next();
    let decibels = decibels.and_then(|before| before.rsplit(char::is_whitespace).next());
    let decibels: f64 = decibels.context("a figure")?.parse().context("a number")?;
    ensure!(decibels > 14.0, "{said}");
    let out = dir.path().join("out");
    let out = |name: &str| out.join(name).display().to_string();
    let orbit = format!("render own --subject ada --orbit 0 --out {}", out("orbit"));
    yoto(&orbit, succeed)?;
    // A motion of the same tree, from a file.
    let file = format!(
        "render own --subject ada --motion-file {ada}/poses.json --out {}",
        out("file")
    );
    yoto(&file, succeed)?;

    // A motion with another person's tree is refused, and so is training both together: each refusal names the
    // tree.
    let motion = format!(
        "render own --subject ada --motion bruno --out {}",
        out("motion")
    );
    let said = yoto(&motion, fail)?;
    ensure!(
        said.contains("share 0 of 19 joint names") && said.contains("own pelvis"),
        "{said}"
    );
    let said = yoto(
        "train both --subjects ada,bruno --tier draft --steps 1",
        fail,
    )?;
    ensure!(
        said.contains("joint 0 is 'own pelvis' in one and 'pelvis' in the other"),
        "{said}"
    );
    Ok(())
}

/// Writes the pictures, masks, BVH file and camera of `person`, as a motion-capture studio has them.
fn write_studio(person: &SyntheticPerson, dir: &std::path::Path) -> anyhow::Result<()> {
    let (track, images) = person.capture(FRAMES, SIZE);
    write_images(&track, &images, dir)?;
    std::fs::remove_file(dir.join("poses.json"))?;
    std::fs::write(
        dir.join("walk.bvh"),
        bvh(&track, 0.01, &UNTURNED, &UNTURNED),
    )?;
    let (mut k, e) = (track.frames[0].k, track.frames[0].e);
    // OpenCV's files count from the first pixel's centre.
    k[0][2] -= 0.5;
    k[1][2] -= 0.5;
    let matrix = |name: &str, columns: usize, numbers: &[f64]| {
        let data: Vec<String> = numbers.iter().map(|it| format!("{it:.9}")).collect();
        format!(
            "{name}: !!opencv-matrix\n  rows: 3\n  cols: {columns}\n  dt: d\n  data: [{}]\n",
            data.join(", ")
        )
    };
    let rotation: Vec<f64> = e[..3].iter().flat_map(|row| row[..3].to_vec()).collect();
    let shift: Vec<f64> = e[..3].iter().map(|row| row[3]).collect();
    let head = "%YAML:1.0\n---\nnames:\n  - \"01\"\n";
    let intri = format!("{head}{}", matrix("K_01", 3, k.as_flattened()));
    let extri = matrix("Rot_01", 3, &rotation) + &matrix("T_01", 1, &shift);
    std::fs::write(dir.join("intri.yml"), intri)?;
    std::fs::write(dir.join("extri.yml"), format!("{head}{extri}"))?;
    Ok(())
}

#[test]
fn people_keep_the_joints_of_their_bvh_files_and_exchange_motions() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let cast = SyntheticPerson::cast(2, 7);
    let service = Service::start(YOTO, &dir.path().join("data"), true)?;
    let path = |name: &str| dir.path().join(name).display().to_string();
    let run = |line: &str| succeed(YOTO, &line.split(' ').collect::<Vec<_>>());
    let yoto = |line: &str, run: Run| service.ask(YOTO, line, run);
    for (person, name) in cast.iter().zip(["ada", "bruno"]) {
        let studio = dir.path().join(format!("{name}-studio"));
        write_studio(person, &studio)?;
        let (studio, capture) = (studio.display().to_string(), path(name));
        run(&format!(
            "import {studio}/frames --poses {studio}/walk.bvh --masks {studio}/masks --keep-skeleton --out {capture}"
        ))?;
        let track = std::fs::read(dir.path().join(name).join("poses.json"))?;
        let track = PoseTrack::from_json(&track).map_err(|found| anyhow::anyhow!("{found:?}"))?;
        ensure!(track.skeleton.names.len() == 22, "{:?}", track.skeleton);
        ensure!(track.skeleton.names[0] == "Hips", "{:?}", track.skeleton);
        let said = run(&format!("capture check {capture} --out {capture}/check"))?;
        ensure!(!said.contains("fail"), "{said}");
        yoto(&format!("subject add {name} {capture}"), succeed)?;
    }
    let said = yoto(
        "train both --subjects ada,bruno --tier draft --steps 60",
        succeed,
    )?;
    ensure!(said.contains(" dB in the box"), "{said}");
    let out = path("out");
    yoto(
        &format!("render both --subject ada --motion bruno --out {out}/driven"),
        succeed,
    )?;
    let file = path("bruno-studio/walk.bvh");
    yoto(
        &format!("render both --subject ada --motion-file {file} --keep-skeleton --out {out}/file"),
        succeed,
    )?;
    // Without the option, the file moves SMPL's joints, which these people do not have.
    let said = yoto(
        &format!("render both --subject ada --motion-file {file} --out {out}/smpl"),
        fail,
    )?;
    ensure!(said.contains("share 0 of 22 joint names"), "{said}");
    Ok(())
}
