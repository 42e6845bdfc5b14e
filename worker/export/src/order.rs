//! The export of a person in one form, with all of its files.

use crate::clip::Clip;
use crate::mesh::{self, MeshOptions};
use crate::rights::with_rights;
use crate::source::{Source, SourceError, clips};
use crate::{gaussians, page};
use std::io;
use yoto_avatar::render::SkinnedSplats;
use yoto_capture::camera::Pose;
use yoto_capture::skeleton::transform::inverse;
use yoto_capture::skeleton::{Skeleton, SkeletonError};
use yoto_formats::splats;
use yoto_proto::exports::content_type;
use yoto_proto::v1::ExportForm;

/// Most poses for the mean light of a texture.
const LIGHT_POSES: usize = 50;
/// Bytes that a file aims at, as a share of the most.
const AIM: f64 = 0.98;
/// Share of the most bytes from which on a file has enough.
const FULL: f64 = 0.9;
/// Most numbers of splats that are tried for a file, after one splat.
const TRIES: usize = 8;

/// The options of an export.
#[derive(Debug)]
pub struct Order<'a> {
    /// The form.
    pub form: ExportForm,
    /// Name of the person, for people who open the file.
    pub title: &'a str,
    /// Name of the files without their extensions, by which the files refer to each other.
    pub stem: &'a str,
    /// The clips of a form with motion, or the motion of `frame`.
    pub motions: &'a [Source],
    /// For a still form, the number of the frame of the first motion; `None` is the rest pose.
    pub frame: Option<u32>,
    /// Limits of a mesh.
    pub mesh: MeshOptions,
    /// What the person agrees to, in one line that the files say; empty: nothing.
    pub rights: &'a str,
    /// Most bytes of a page or a file of splats.
    pub max_bytes: Option<u64>,
}

/// An exported person.
#[derive(Debug)]
pub struct Exported {
    /// The files, the main one first.
    pub files: Vec<File>,
    /// Number of splats, of a page or a file of splats.
    pub splats: Option<usize>,
    /// Number of triangles and side of the texture in pixels, of a mesh.
    pub mesh: Option<(usize, u32)>,
}

impl Exported {
    /// Bytes of all files.
    fn bytes(&self) -> u64 {
        self.files.iter().map(|file| file.bytes.len() as u64).sum()
    }
}

/// One file.
#[derive(Debug)]
pub struct File {
    /// E.g. `ada.glb`.
    pub name: String,
    /// E.g. `model/gltf-binary`.
    pub content_type: &'static str,
    /// The content.
    pub bytes: Vec<u8>,
}

/// Why a person can't be exported.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// A form that this version does not know.
    #[error("the form is not known")]
    Form,
    /// A motion is invalid, or its body differs too much from the person's.
    #[error(transparent)]
    Motion(#[from] SourceError),
    /// A motion is of another body.
    #[error("the motions")]
    Pose(#[from] SkeletonError),
    /// The splats can't be written.
    #[error("the splats")]
    Splats(#[source] io::Error),
    /// The splats have no surface.
    #[error("the surface of the person")]
    Surface(#[from] mesh::MeshError),
    /// No number of splats is few enough.
    #[error("{max} bytes are too few: with one splat, the file has {least}")]
    TooFewBytes {
        /// The limit.
        max: u64,
        /// Bytes with one splat.
        least: u64,
    },
    /// The mesh can't be written.
    #[error("the mesh")]
    Mesh(#[from] mesh::glb::GlbError),
}

impl Order<'_> {
    /// The files of `person`.
    ///
    /// # Errors
    /// If a motion does not fit the person, there is no such frame, the splats enclose nothing, or one splat has more bytes
    /// than `max_bytes`.
    pub fn of(&self, person: &SkinnedSplats) -> Result<Exported, ExportError> {
        match self.form {
            ExportForm::Unspecified => Err(ExportError::Form),
            ExportForm::Page => {
                let clips = clips(self.motions, &person.skeleton)?;
                self.within(person, &|person| self.page(person, &clips))
            }
            form if form.is_mesh() => self.mesh(person),
            _ => self.within(person, &|person| self.splats(person)),
        }
    }

    /// What `write` makes of `person`, with fewer splats if it would exceed `max_bytes`.
    fn within(
        &self,
        person: &SkinnedSplats,
        write: &dyn Fn(&SkinnedSplats) -> Result<Exported, ExportError>,
    ) -> Result<Exported, ExportError> {
        let whole = write(person)?;
        let Some(max) = self.max_bytes.filter(|max| whole.bytes() > *max) else {
            return Ok(whole);
        };
        let bytes_of = |count: usize| -> Result<(u64, Exported), ExportError> {
            let file = write(&person.reduced_to(count))?;
            Ok((file.bytes(), file))
        };
        let (least, smallest) = bytes_of(1)?;
        if least > max {
            return Err(ExportError::TooFewBytes { max, least });
        }
        let mut below = (1, least, smallest);
        let mut above = (person.splats.len(), whole.bytes());
        for _ in 0..TRIES {
            if below.1 as f64 >= FULL * max as f64 || above.0 <= below.0 + 1 {
                break;
            }
            // Bytes grow with the splats, nearly in proportion where they are compressed.
            let per_splat = (above.1 - below.1) as f64 / (above.0 - below.0) as f64;
            let more = ((AIM * max as f64 - below.1 as f64) / per_splat).max(1.0) as usize;
            let count = (below.0 + more).min(above.0 - 1);
            let (bytes, file) = bytes_of(count)?;
            match bytes > max {
                true => above = (count, bytes),
                false => below = (count, bytes, file),
            }
        }
        Ok(below.2)
    }

    fn page(&self, person: &SkinnedSplats, clips: &[Clip]) -> Result<Exported, ExportError> {
        let page = page::page(self.title, person, clips)?;
        Ok(self.with_splats(page.into_bytes(), person.splats.len()))
    }

    /// One pose of the person, with the root where it is at rest.
    fn splats(&self, person: &SkinnedSplats) -> Result<Exported, ExportError> {
        let skeleton = &person.skeleton;
        let still = self.still(skeleton)?;
        let pose = still.unwrap_or_else(|| Pose::rest(skeleton.joints()));
        let to_rest = inverse(&skeleton.body_to_world(&pose));
        let gaussians = gaussians::posed(person, &pose, &to_rest)?;
        let mut bytes = Vec::new();
        match self.form {
            ExportForm::SplatsPly => splats::ply::write(&mut bytes, &gaussians),
            ExportForm::SplatsSpz => splats::spz::write(&mut bytes, &gaussians),
            _ => splats::glb::write(&mut bytes, &gaussians),
        }
        .map_err(ExportError::Splats)?;
        Ok(self.with_splats(bytes, gaussians.len()))
    }

    fn mesh(&self, person: &SkinnedSplats) -> Result<Exported, ExportError> {
        let skeleton = &person.skeleton;
        let (clips, still) = match self.form.is_still() {
            true => (Vec::new(), self.still(skeleton)?),
            false => (clips(self.motions, skeleton)?, None),
        };
        let mut mesh = mesh::mesh(person, &light(&clips, &still), &self.mesh)?;
        if let Some(pose) = &still {
            let to_rest = inverse(&skeleton.body_to_world(pose));
            mesh = mesh::still::posed(&mesh, skeleton, pose, &to_rest)?;
        }
        let contents = match self.form {
            ExportForm::MeshObj => {
                let files =
                    mesh::obj::files(&mesh, self.stem).map_err(mesh::glb::GlbError::from)?;
                vec![
                    files.obj.into_bytes(),
                    files.mtl.into_bytes(),
                    files.texture,
                ]
            }
            ExportForm::MeshPly => {
                let mut bytes = Vec::new();
                mesh::ply::write(&mut bytes, &mesh).map_err(mesh::glb::GlbError::from)?;
                vec![bytes]
            }
            _ => {
                let mut bytes = Vec::new();
                mesh::glb::write(&mut bytes, self.title, &mesh, skeleton, &clips)?;
                vec![bytes]
            }
        };
        Ok(Exported {
            files: self.files(contents),
            splats: None,
            mesh: Some((mesh.triangles.len(), mesh.side)),
        })
    }

    /// The pose of a still form, if it is not the rest pose.
    fn still(&self, body: &Skeleton) -> Result<Option<Pose>, SourceError> {
        let chosen = self.motions.first().zip(self.frame);
        chosen
            .map(|(motion, frame)| motion.pose(frame, body))
            .transpose()
    }

    fn with_splats(&self, bytes: Vec<u8>, splats: usize) -> Exported {
        Exported {
            files: self.files(vec![bytes]),
            splats: Some(splats),
            mesh: None,
        }
    }

    /// Files of these `contents`, in the order of the form's extensions.
    fn files(&self, contents: Vec<Vec<u8>>) -> Vec<File> {
        let extensions = self.form.extensions().iter();
        let files = extensions.zip(contents);
        files
            .map(|(extension, bytes)| File {
                name: format!("{}.{extension}", self.stem),
                content_type: content_type(extension),
                bytes: with_rights(extension, bytes, self.rights),
            })
            .collect()
    }
}

/// The poses for the mean light of the texture: a sample of the clips', or the single one.
fn light(clips: &[Clip], still: &Option<Pose>) -> Vec<Pose> {
    let all = || clips.iter().flat_map(|clip| &clip.poses);
    let every = all().count().div_ceil(LIGHT_POSES).max(1);
    all().step_by(every).chain(still).cloned().collect()
}
