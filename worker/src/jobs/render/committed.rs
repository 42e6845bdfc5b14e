//! Files that the job commits one by one: users see each at once, and another lease of the job continues at the
//! first missing one.

use crate::jobs::{JobContext, JobFailure};
use std::collections::BTreeMap;
use yoto_media::png::{self, Pixels};
use yoto_proto::keys;
use yoto_proto::v1::RenderedFile;
use yoto_proto::worker::v1::Inputs;

/// The files of a render.
pub(super) struct Committed<'a> {
    context: &'a JobContext,
    /// Files of the render, by name.
    files: BTreeMap<String, Known>,
}

/// A committed file.
struct Known {
    file: RenderedFile,
    /// Whether it was written or read during this lease. One of an earlier lease may be damaged since.
    sound: bool,
}

impl<'a> Committed<'a> {
    pub(super) fn new(context: &'a JobContext, inputs: &Inputs) -> Self {
        let mut files = Self {
            context,
            files: BTreeMap::new(),
        };
        for file in &inputs.outputs {
            files.know(file.clone(), false);
        }
        files
    }

    fn know(&mut self, file: RenderedFile, sound: bool) {
        self.files.insert(file.file.clone(), Known { file, sound });
    }

    /// Adds files that other leases committed meanwhile.
    pub(super) fn learn(&mut self, files: Vec<RenderedFile>) {
        for file in files {
            let known = self.files.get(&file.file);
            if known.is_none_or(|it| it.file != file) {
                self.know(file, true);
            }
        }
    }

    /// Whether a file is there and was written or read during this lease.
    pub(super) fn is_sound(&self, file: &str) -> bool {
        self.files.get(file).is_some_and(|it| it.sound)
    }

    /// The pixels of a picture that an earlier lease committed. `None` without such a picture, or if it was
    /// damaged since: then it is drawn again.
    pub(super) fn take_over(
        &mut self,
        file: &str,
        kind: Pixels,
    ) -> Result<Option<Vec<u8>>, JobFailure> {
        let Some(known) = self.files.get_mut(file) else {
            return Ok(None);
        };
        let Some(object) = &known.file.object else {
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
        let (_, _, pixels) = png::decode(kind, &bytes)?;
        known.sound = true;
        Ok(Some(pixels))
    }

    /// Stores and commits a file. It replaces a damaged one.
    pub(super) fn add(&mut self, file: String, bytes: Vec<u8>) -> Result<(), JobFailure> {
        let key = keys::render(self.context.job_id()?, self.context.claim.token, &file);
        let object = Some(self.context.put(&key, bytes)?);
        let file = RenderedFile { file, object };
        self.context.commit(file.clone())?;
        self.know(file, true);
        Ok(())
    }

    /// All files: the pictures in the order of the views, then the animation.
    pub(super) fn into_files(self) -> Vec<RenderedFile> {
        self.files.into_values().map(|it| it.file).collect()
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
        let bytes = png::encode(Pixels::Rgb, 2, 2, &pixels).expect("encodes");
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
        assert!(files.is_sound("a.png") && !files.is_sound("torn.png"));
        // Under its own key: it is the earlier lease's object.
        assert_eq!(files.into_files()[0], file("a.png", &good));
    }

    #[test]
    fn what_others_commit_meanwhile_needs_no_look_and_what_was_there_before_does() {
        let runtime = tokio::runtime::Runtime::new().expect("a runtime");
        let _inside = runtime.enter();
        let context = context();
        let file = |name: &str, bytes| RenderedFile {
            file: name.into(),
            object: Some(ObjectRef {
                bytes,
                ..ObjectRef::default()
            }),
        };
        let inputs = Inputs {
            outputs: vec![file("000000.png", 1), file("000001.png", 1)],
            ..Inputs::default()
        };
        let mut files = Committed::new(&context, &inputs);
        // The second one was damaged and drawn again by another worker.
        let others = [("000000.png", 1), ("000001.png", 2), ("000002.png", 3)];
        files.learn(others.map(|(name, bytes)| file(name, bytes)).to_vec());
        let sound = others.map(|(name, _)| files.is_sound(name));
        assert_eq!(sound, [false, true, true]);
        let expected = others.map(|(name, bytes)| file(name, bytes));
        assert_eq!(files.into_files(), expected);
    }
}
