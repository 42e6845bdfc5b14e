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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::jobs::test_context::context;
    use yoto_proto::v1::ObjectRef;

    #[test]
    fn a_picture_of_an_earlier_lease_is_taken_over_unless_it_is_damaged() {
        let runtime = tokio::runtime::Runtime::new().expect("a runtime");
        let _inside = runtime.enter();
        let context = context();
        let pixels: Vec<u8> = (0..12).collect();
        let bytes = picture::png(Pixels::Rgb, 2, 2, &pixels).expect("encodes");
        let good = context.put("renders/test/2/a.png", bytes.clone());
        let good = good.expect("puts");
        let torn = ObjectRef {
            bytes: good.bytes + 1,
            ..good.clone()
        };
        let lost = ObjectRef {
            key: "renders/test/2/none.png".into(),
            ..good.clone()
        };
        let file = |name: &str, object: &ObjectRef| RenderedFile {
            file: name.into(),
            object: Some(object.clone()),
        };
        let inputs = Inputs {
            outputs: vec![
                file("a.png", &good),
                file("torn.png", &torn),
                file("lost.png", &lost),
            ],
            ..Inputs::default()
        };
        let mut files = Committed::new(&context, &inputs);
        let mut take = |name: &str| files.take_over(name, Pixels::Rgb).expect("reads");
        assert_eq!(take("a.png"), Some(pixels));
        assert_eq!(take("torn.png"), None);
        assert_eq!(take("lost.png"), None);
        assert_eq!(take("new.png"), None);
        // Under its own key: it is the earlier lease's object.
        assert_eq!(files.into_files(), [file("a.png", &good)]);
    }
}
