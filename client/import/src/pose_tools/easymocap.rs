//! EasyMocap: a folder `smpl/` (or `output/smpl/`) of `%06d.json`, one a frame, from 0.
//!
//! A list of people: `id`, `Rh`, `Th` `[1, 3]`, `poses` `[1, 72]` (or 69 without the root's three, which
//! are 0), `shapes` `[1, 10]`. The posed body is turned by Rh about the world's origin and moved by Th,
//! metres: a `Th` that is SMPL's translation is another meaning, which masks tell apart. Cameras are
//! `intri.yml` and `extri.yml` of OpenCV, beside the folder or above it: `K_<name>`, `Rot_<name>`,
//! `T_<name>`, and the lens's `dist_<name>`; without `extri.yml` the world is the camera's.

use super::frames::number_in;
use super::phalp::push;
use super::tool::{Found, Intrinsics, Seen};
use crate::Options;
use crate::geometry::extrinsics;
use crate::source::{Part, Source};
use crate::track::SmplPose;
use yoto_client::ClientError;
use yoto_proto::pose_track::NO_DISTORTION;

pub(super) fn fits(root: &Part<'_>) -> bool {
    let people = root.find("annots").unwrap_or_else(|| root.clone());
    let first = people.at(0);
    first.is_ok_and(|person| person.find("Rh").is_some() && person.find("Th").is_some())
}

pub(super) fn read(source: &Source, file: &str, options: &Options) -> Result<Found, ClientError> {
    let folder = file.rsplit_once('/').map_or("", |(folder, _)| folder);
    let camera = calibration(source, folder, options)?;
    if camera.is_none() && options.focal.is_none() {
        let message = "there is no intri.yml beside the poses or above them, nor a --focal";
        return Err(source.fault("MISSING", "intri.yml", None, "", message));
    }
    let mut found = Found::of(Vec::new());
    found.distortion = camera
        .as_ref()
        .map_or(NO_DISTORTION, |camera| camera.distortion);
    for (order, name) in source.list(folder, &[".json"])?.iter().enumerate() {
        let name = name.trim_start_matches('/');
        let number = number_in(name).unwrap_or(order);
        let data = source.data(name, Some(number as u32))?;
        let root = data.root();
        let people = root.find("annots").unwrap_or(root);
        for at in 0..people.len()? {
            let part = people.at(at)?;
            let mut seen = person(&part, number)?;
            if let Some(camera) = &camera {
                (seen.intrinsics, seen.e) = (Some(camera.intrinsics), camera.e);
            }
            let id = part.find("id").map_or(Ok(at as f64), |id| id.number())?;
            push(&mut found.people, id.to_string(), seen);
        }
    }
    Ok(found)
}

fn person(part: &Part<'_>, number: usize) -> Result<Seen, ClientError> {
    let mut pose: SmplPose = [0.0; 72];
    let body = part.get("poses")?;
    let values = body.vector()?;
    match values.len() {
        69 => pose[3..].copy_from_slice(&values),
        72 => pose.copy_from_slice(&values),
        // SMPL-H and SMPL-X: the root and 21 joints are SMPL's.
        66.. => pose[..66].copy_from_slice(&values[..66]),
        short => {
            let message = format!("{short} numbers, SMPL has 72 or, without the root, 69");
            return Err(body.fault("SIZE_MISMATCH", message));
        }
    }
    if pose[..3].iter().any(|v| *v != 0.0) {
        let message = "the root turns here and by Rh: the tool writes zeros here";
        return Err(body.fault("INVALID", message));
    }
    pose[..3].copy_from_slice(&part.get("Rh")?.fixed::<3>()?);
    let t = part.get("Th")?.fixed()?;
    Ok(Seen::new(number, pose, t, part.get("shapes")?.vector()?))
}

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
) -> Result<Option<Calibration>, ClientError> {
    let places = [
        format!("{folder}/"),
        format!("{folder}/../"),
        format!("{folder}/../../"),
    ];
    let place = places
        .iter()
        .find(|place| source.has(relative(place, "intri.yml")));
    let Some(place) = place else {
        return Ok(None);
    };
    let file = relative(place, "intri.yml");
    let text = text(source, &file)?;
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
    let file = relative(place, "extri.yml");
    if !source.has(&file) {
        return Ok(Some(camera));
    }
    let text = self::text(source, &file)?;
    let turn: Option<[f64; 9]> =
        matrix(&text, &format!("Rot_{name}")).and_then(|m| m.try_into().ok());
    let turn = turn.ok_or_else(|| wrong(&file, format!("Rot_{name}")))?;
    let t: Option<[f64; 3]> = matrix(&text, &format!("T_{name}")).and_then(|m| m.try_into().ok());
    let t = t.ok_or_else(|| wrong(&file, format!("T_{name}")))?;
    let rows = std::array::from_fn(|i| std::array::from_fn(|j| turn[3 * i + j]));
    camera.e = Some(extrinsics(&rows, t));
    Ok(Some(camera))
}

fn relative(place: &str, file: &str) -> String {
    format!("{}{file}", place.trim_start_matches('/'))
}

fn text(source: &Source, file: &str) -> Result<String, ClientError> {
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
