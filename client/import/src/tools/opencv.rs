//! OpenCV's `intri.yml` and `extri.yml`, with the cameras of a rig by name.
//!
//! `K_<name>` `[3, 3]`, and the lens's `dist_<name>` or `D_<name>`; `Rot_<name>` `[3, 3]` and `T_<name>`
//! `[3]`, world to camera, metres.

use crate::geometry::extrinsics;
use crate::proof::Intrinsics;
use crate::source::Source;
use crate::{ImportError, Options};
use yoto_proto::pose_track::NO_DISTORTION;

/// A camera of OpenCV's files.
pub(crate) struct Calibration {
    pub intrinsics: Intrinsics,
    pub distortion: [f64; 5],
    /// World to camera; `None` where the world is the camera's.
    pub e: Option<[[f64; 4]; 4]>,
}

/// The camera of `--view`, from OpenCV's files near the folder.
pub(crate) fn calibration(
    source: &Source,
    folder: &str,
    options: &Options,
) -> Result<Option<Calibration>, ImportError> {
    let folders = [
        format!("{folder}/"),
        format!("{folder}/../"),
        format!("{folder}/../../"),
    ];
    let nearest = folders
        .iter()
        .find(|folder| source.has(relative(folder, "intri.yml")));
    let Some(folder) = nearest else {
        return Ok(None);
    };
    let file = relative(folder, "intri.yml");
    let text = read_text(source, &file)?;
    let view = options.camera.unwrap_or(0);
    let name = names(&text).get(view).cloned().ok_or_else(|| {
        let message = format!("there is no camera {view}");
        source.fault("MISSING", &file, None, "names", message)
    })?;
    let wrong = |file: &str, field: String| {
        let message = "there is no such matrix, or it has another size";
        source.fault("MISSING", file, None, field, message)
    };
    let k = matrix(&text, &format!("K_{name}")).filter(|k| k.len() == 9);
    let k = k.ok_or_else(|| wrong(&file, format!("K_{name}")))?;
    let (Some(fx), Some(fy), Some(cx), Some(cy)) = (k.first(), k.get(4), k.get(2), k.get(5)) else {
        return Err(wrong(&file, format!("K_{name}")));
    };
    let intrinsics = Intrinsics {
        focal: [*fx, *fy],
        centre: Some([*cx, *cy]),
        size: None,
        margin: 0.0,
    };
    let lens = ["dist", "D"].map(|kind| format!("{kind}_{name}"));
    let distortion = match lens.into_iter().find(|field| is_there(&text, field)) {
        Some(field) => distortion(matrix(&text, &field)).ok_or_else(|| {
            let message = "not the 5 numbers k1 k2 p1 p2 k3 of a lens, nor the first 4 of them";
            source.fault("UNREADABLE", &file, None, field, message)
        })?,
        None => NO_DISTORTION,
    };
    let mut camera = Calibration {
        intrinsics,
        distortion,
        e: None,
    };
    let file = relative(folder, "extri.yml");
    if !source.has(&file) {
        return Ok(Some(camera));
    }
    let text = read_text(source, &file)?;
    let rotation: Option<[f64; 9]> =
        matrix(&text, &format!("Rot_{name}")).and_then(|m| m.try_into().ok());
    let rotation = rotation.ok_or_else(|| wrong(&file, format!("Rot_{name}")))?;
    let t: Option<[f64; 3]> = matrix(&text, &format!("T_{name}")).and_then(|m| m.try_into().ok());
    let t = t.ok_or_else(|| wrong(&file, format!("T_{name}")))?;
    let rows = std::array::from_fn(|i| std::array::from_fn(|j| rotation[3 * i + j]));
    camera.e = Some(extrinsics(&rows, t));
    Ok(Some(camera))
}

fn relative(folder: &str, file: &str) -> String {
    format!("{}{file}", folder.trim_start_matches('/'))
}

fn read_text(source: &Source, file: &str) -> Result<String, ImportError> {
    String::from_utf8(source.bytes(file, None)?)
        .map_err(|_| source.fault("UNREADABLE", file, None, "", "this is not text"))
}

/// The list `names` of a file of OpenCV's.
fn names(text: &str) -> Vec<String> {
    let lines = text
        .lines()
        .skip_while(|line| !line.starts_with("names:"))
        .skip(1);
    let items = lines.map_while(|line| line.trim().strip_prefix('-'));
    items
        .map(|name| name.trim().trim_matches('"').to_owned())
        .collect()
}

/// The lens of OpenCV's 4 or 5 numbers.
fn distortion(numbers: Option<Vec<f64>>) -> Option<[f64; 5]> {
    let mut numbers = numbers?;
    if numbers.len() == 4 {
        numbers.push(0.0);
    }
    numbers.try_into().ok()
}

/// Whether a file of OpenCV's has an entry of this name, of any content.
fn is_there(text: &str, name: &str) -> bool {
    let start = format!("{name}:");
    text.lines().any(|line| line.starts_with(&start))
}

/// The numbers of a matrix of a file of OpenCV's, rows first.
fn matrix(text: &str, name: &str) -> Option<Vec<f64>> {
    let start = format!("{name}:");
    let mut at = 0;
    for line in text.split_inclusive('\n') {
        if line.starts_with(&start) {
            let rest = text.get(at..)?;
            let data = rest
                .split_once("data:")?
                .1
                .split_once('[')?
                .1
                .split_once(']')?
                .0;
            let numbers = data.split(',').map(|number| number.trim().parse::<f64>());
            let numbers: Vec<f64> = numbers.collect::<Result<_, _>>().ok()?;
            return numbers.iter().all(|v| v.is_finite()).then_some(numbers);
        }
        at += line.len();
    }
    None
}
