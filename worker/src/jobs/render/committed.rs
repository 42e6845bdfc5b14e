//! Files that the job commits one by one: users see each at once, and another lease of the job goes on at
//! the first missing one.

use crate::{
    jobs::{JobContext, JobFailure},
    media::{Pixels, picture},
};
use std::collections::HashMap;
use yoto_proto::{
    keys,
    v1::{Inputs, RenderedFile},
};

/// The files of a render.
pub(super) struct Committed<'a> {
    context: &'a JobContext,
    /// Files of earlier leases, by name.
    earlier: HashMap<&'a str, &'a RenderedFile>,
    /// All files, in the order of the views.
    files: Vec<RenderedFile>,
}

impl<'a> Committed<'a> {
    pub(super) fn new(context: &'a JobContext, inputs: &'a Inputs) -> Self {
        let earlier = inputs.outputs.iter().map(|it| (&*it.file, it));
        Self {
            context,
            earlier: earlier.collect(),
            files: Vec::new(),
        }
    }

    /// Takes over a picture of an earlier lease; its pixels. None if there is none, or it was damaged
    /// since: then it is made again.
    pub(super) fn take_over(
        &mut self,
        file: &str,
        kind: Pixels,
    ) -> Result<Option<Vec<u8>>, JobFailure> {
        let Some(&earlier) = self.earlier.get(file) else {
            return Ok(None);
        };
        let Some(object) = &earlier.object else {
            return Ok(None);
        };
        let bytes = match self.context.get(object)? {
            Ok(bytes) => bytes,
            Err(error) if error.is_torn() => {
                tracing::warn!(job = self.context.claim.job, %error, "a committed picture is torn");
                return Ok(None);
            }
            Err(error) => return Err(error.into()),
        };
        let (_, _, pixels) = picture::pixels(kind, &bytes)?;
        self.files.push(earlier.clone());
        Ok(Some(pixels))
    }

    /// Stores and commits a file. It takes the place of a damaged one.
    pub(super) fn add(&mut self, file: String, bytes: Vec<u8>) -> Result<(), JobFailure> {
        let key = keys::render(self.context.job_id()?, self.context.claim.token, &file);
        let object = Some(self.context.put(&key, bytes)?);
        let file = RenderedFile { file, object };
        self.context.commit(file.clone())?;
        self.files.push(file);
        Ok(())
    }

    /// All files.
    pub(super) fn into_files(self) -> Vec<RenderedFile> {
        self.files
    }
}
