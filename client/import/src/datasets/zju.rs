//! ZJU-MoCap, in EasyMocap's layout.
//!
//! `annots.npy`: a pickled dictionary. `cams` has lists over the cameras: `K` `[3, 3]`, `D`
//! `[5, 1]` (OpenCV's k1 k2 p1 p2 k3), `R` `[3, 3]`, `T` `[3, 1]` in **millimetres**; world to
//! camera. `ims` has one dictionary per frame, whose `ims` lists one image path per camera.
//! `new_params/<i>.npy`: `poses` `[1, 72]`, `shapes` `[1, 10]`, `Rh`, `Th` `[1, 3]` (metres): the
//! posed body is turned by Rh about the *world's* origin and moved by Th. `<i>` counts frames,
//! except where the images are called `…)_0001_…`: then it is that number (subjects 313, 315).
//! `mask/` and `mask_cihp/`: label images at the image's path; what is not 0 in either is the
//! person. Pixel coordinates count from the first pixel's centre.

use crate::geometry::{Vec3, extrinsics};
use crate::pictures::{Mask, MaskKind, PictureFiles, Pictures, image_size};
use crate::rest_joints::RestJoints;
use crate::source::{Faulty, FileData, Part, Source};
use crate::track::{Camera, WorldPose, empty_track, mean, smpl_skeleton};
use crate::{Findings, ImportError, Imported, Options};
use std::path::{Component, Path};

const ANNOTS: &str = "annots.npy";

/// A frame's files and body.
struct SmplFrame {
    index: u32,
    betas: Vec<f64>,
    poses: [f64; 72],
    rh: Vec3,
    th: Vec3,
}

pub(crate) fn read(source: &Source, options: &Options) -> Result<Imported, ImportError> {
    let rest = RestJoints::needed(options, source, "new_params")?;
    let annots = source.data(ANNOTS, None)?;
    let view = options.camera.unwrap_or(0);
    let (camera, distortion) = camera(&annots, view)?;
    let ims = annots.root().get("ims")?;
    let mut notes = Vec::new();
    let (mut bodies, mut pictures) = (Vec::new(), Vec::new());
    let mut faulty = Faulty::default();
    for position in options.positions(source, ANNOTS, ims.len()?)? {
        if let Some((body, files)) = faulty.keep(frame(source, &ims, position, view))? {
            bodies.push(body);
            pictures.push(files);
        }
    }
    faulty.finish(&mut notes)?;
    let betas: Vec<Vec<f64>> = bodies.iter().map(|body| body.betas.clone()).collect();
    let rest_joints = rest.joints(&mean(&betas));
    let rest_root = rest_joints.first().copied().unwrap_or_default();
    let first = pictures.first().zip(bodies.first());
    let size = first.map(|(files, body)| image_size(&files.image, body.index));
    let fps = options.fps_or(None, &mut notes);
    let mut track = empty_track(
        smpl_skeleton(rest_joints),
        size.transpose()?.unwrap_or_default(),
        fps,
    );
    track.distortion = distortion;
    track.frames = bodies
        .iter()
        .map(|body| {
            let pelvis = rest
                .joints(&body.betas)
                .first()
                .copied()
                .unwrap_or_default();
            WorldPose::about_origin(body.poses, body.rh, body.th, pelvis)
                .frame(body.index, rest_root, &camera)
        })
        .collect();
    Ok(Imported {
        track,
        pictures: Pictures::Files(pictures),
        available: ims.len()?,
        notes,
        found: Findings::default(),
    })
}

/// The body and the files of the frame at `position`, seen by camera `view`.
fn frame(
    source: &Source,
    ims: &Part<'_>,
    position: usize,
    view: usize,
) -> Result<(SmplFrame, PictureFiles), ImportError> {
    let index = position as u32;
    let path = ims.at(position)?.of_frame(index).get("ims")?.at(view)?;
    let image = relative(&path)?;
    let files = files(source, image, index)?;
    let number = number_in_name(image).unwrap_or(position);
    Ok((body(source, number, index)?, files))
}

/// Camera `view` of the rig, in metres, and its distortion.
fn camera(annots: &FileData<'_>, view: usize) -> Result<(Camera, [f64; 5]), ImportError> {
    let cams = annots.root().get("cams")?;
    let k: [f64; 9] = of_view(&cams.get("K")?, view)?;
    let r: [f64; 9] = of_view(&cams.get("R")?, view)?;
    let t: [f64; 3] = of_view(&cams.get("T")?, view)?;
    let distortion: [f64; 5] = of_view(&cams.get("D")?, view)?;
    let square = |m: [f64; 9]| std::array::from_fn(|i| std::array::from_fn(|j| m[3 * i + j]));
    let e = extrinsics(&square(r), t.map(|millimetres| millimetres / 1000.0));
    Ok((Camera::from_centres(square(k), e), distortion))
}

/// The `N` numbers of camera `view`, of a list of arrays or of one array with one more axis.
fn of_view<const N: usize>(part: &Part<'_>, view: usize) -> Result<[f64; N], ImportError> {
    let array = part.array()?;
    let cameras = array.shape.first().copied().unwrap_or_default();
    if cameras == 0 || array.values.len() != cameras * N {
        let message = format!(
            "the shape is {:?}, {N} numbers per camera are needed",
            array.shape
        );
        return Err(part.fault("SIZE_MISMATCH", message));
    }
    let numbers = array.values.as_chunks::<N>().0.get(view).copied();
    numbers.ok_or_else(|| {
        let message = format!("there is no camera {view}: there are {cameras}");
        part.fault("MISSING", message)
    })
}

/// An image's path, which must stay inside the capture.
fn relative<'a>(part: &Part<'a>) -> Result<&'a Path, ImportError> {
    let path = Path::new(part.text()?);
    let inside = |component: Component<'_>| matches!(component, Component::Normal(_));
    if path.components().next().is_some() && path.components().all(inside) {
        Ok(path)
    } else {
        Err(part.fault(
            "BAD_NAME",
            format!("'{}' leads outside the capture", path.display()),
        ))
    }
}

/// The number in names such as `CoreView_313_Camera_(1)_0001_2019-08-23_16-08-50.592.jpg`.
fn number_in_name(path: &Path) -> Option<usize> {
    let name = path.file_name()?.to_str()?;
    let (_, rest) = name.split_once(")_")?;
    let digits: String = rest.chars().take_while(char::is_ascii_digit).collect();
    digits.parse().ok()
}

fn files(source: &Source, image: &Path, frame: u32) -> Result<PictureFiles, ImportError> {
    let below = Path::new("images").join(image);
    let found = if source.has(image) || !source.has(&below) {
        source.path(image)
    } else {
        source.path(&below)
    };
    let inner = image.strip_prefix("images").unwrap_or(image);
    let masks: Vec<Mask> = ["mask", "mask_cihp"]
        .map(|folder| Path::new(folder).join(inner).with_extension("png"))
        .into_iter()
        .filter(|path| source.has(path))
        .map(|path| Mask::Image(source.path(path), MaskKind::Labels))
        .collect();
    if masks.is_empty() {
        let name = Path::new("mask").join(inner).with_extension("png");
        let message = "there is no such file, neither in mask nor in mask_cihp";
        return Err(source.fault(
            "MISSING",
            &name.display().to_string(),
            Some(frame),
            "",
            message,
        ));
    }
    Ok(PictureFiles {
        image: found,
        masks,
        over_black: false,
    })
}

fn body(source: &Source, number: usize, frame: u32) -> Result<SmplFrame, ImportError> {
    let data = source.data(&format!("new_params/{number}.npy"), Some(frame))?;
    let root = data.root();
    Ok(SmplFrame {
        index: frame,
        betas: root.get("shapes")?.vector()?,
        poses: root.get("poses")?.smpl_pose()?,
        rh: root.get("Rh")?.fixed()?,
        th: root.get("Th")?.fixed()?,
    })
}
