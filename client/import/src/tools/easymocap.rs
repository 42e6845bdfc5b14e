//! EasyMocap: a folder `smpl/` (or `output/smpl/`) of `%06d.json`, one per frame, from 0.
//!
//! A list of people: `id`, `Rh`, `Th` `[1, 3]`, `poses` `[1, 72]` (or 69 without the root's three, which
//! are 0), `shapes` `[1, 10]`. The posed body is turned by Rh about the world's origin and moved by Th,
//! metres: a `Th` that is SMPL's translation is another meaning, which masks tell apart. Cameras are
//! `intri.yml` and `extri.yml` of OpenCV, beside the folder or above it: `K_<name>`, `Rot_<name>`,
//! `T_<name>`, and the lens's `dist_<name>`; without `extri.yml` the world is the camera's.

use super::opencv::calibration;
use super::parts::push;
use super::tool::Tool;
use crate::clip::number_in;
use crate::proof::{Documented, Focal, PoseEstimate, SmplVariant, ToolOutput, Translation};
use crate::source::{Faulty, Part, Source};
use crate::track::SmplPose;
use crate::{ImportError, Options};
use yoto_proto::pose_track::NO_DISTORTION;

pub(crate) static TOOL: Tool = Tool {
    from: "easymocap",
    help: "EasyMocap: --poses a folder with smpl, intri.yml and extri.yml, with one view's video",
    files: "smpl/*.json with Rh and Th, and intri.yml",
    locations: &[
        ("smpl", "", ".json"),
        ("output/smpl", "", ".json"),
        ("output-smpl-3d/smpl", "", ".json"),
    ],
    search_rank: 8,
    has_views: true,
    fits,
    read: |file| read(file.source, file.name, file.options),
    documented: Documented {
        tool: "EasyMocap",
        body: SmplVariant::Smpl,
        focal: Focal::Own,
        focal_without_own: None,
        translation: Translation::AboutOrigin,
    },
};

fn fits(root: &Part<'_>) -> bool {
    let people = root.find("annots").unwrap_or_else(|| root.clone());
    let first = people.at(0);
    first.is_ok_and(|person| person.find("Rh").is_some() && person.find("Th").is_some())
}

fn read(source: &Source, file: &str, options: &Options) -> Result<ToolOutput, ImportError> {
    let folder = file.rsplit_once('/').map_or("", |(folder, _)| folder);
    let camera = calibration(source, folder, options)?;
    if camera.is_none() && options.focal.is_none() {
        let message = "there is no intri.yml beside the poses or above them, nor a --focal";
        return Err(source.fault("MISSING", "intri.yml", None, "", message));
    }
    let (mut found, mut faulty) = (ToolOutput::of(Vec::new()), Faulty::default());
    found.distortion = camera
        .as_ref()
        .map_or(NO_DISTORTION, |camera| camera.distortion);
    for (order, name) in source.list(folder, &[".json"])?.iter().enumerate() {
        let name = name.trim_start_matches('/');
        let number = number_in(name).unwrap_or(order);
        let data = source.data(name, Some(number as u32));
        let counted = data.and_then(|data| {
            let root = data.root();
            let count = root.find("annots").unwrap_or(root).len()?;
            Ok((data, count))
        });
        let (data, count) = match counted {
            Ok(counted) => counted,
            Err(fault) => {
                faulty.keep::<()>(Err(fault))?;
                continue;
            }
        };
        let root = data.root();
        let people = root.find("annots").unwrap_or(root);
        for at in 0..count {
            let part = people.at(at)?;
            let read = person(&part, number).and_then(|seen| {
                let id = part.find("id").map_or(Ok(at as f64), |id| id.number());
                Ok((id?, seen))
            });
            let Some((id, mut seen)) = faulty.keep(read)? else {
                continue;
            };
            if let Some(camera) = &camera {
                (seen.intrinsics, seen.e) = (Some(camera.intrinsics), camera.e);
            }
            push(&mut found.people, id.to_string(), seen);
        }
    }
    faulty.finish(&mut found.notes)?;
    Ok(found)
}

fn person(part: &Part<'_>, number: usize) -> Result<PoseEstimate, ImportError> {
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
    Ok(PoseEstimate::new(
        number,
        pose,
        t,
        part.get("shapes")?.vector()?,
    ))
}
