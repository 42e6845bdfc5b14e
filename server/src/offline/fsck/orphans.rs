//! Objects that nothing names.

use super::verify::Verification;
use yoto_objects::Listed;
use yoto_proto::keys::{self, FolderOwner};
use yoto_store::References;

/// Those of `listed` that nothing names and nobody can commit any more.
pub(super) fn among(
    listed: Vec<Listed>,
    references: &References,
    found: &Verification<'_>,
) -> Vec<Listed> {
    let orphans = listed.into_iter().filter(|it| {
        !found.keys.contains(&it.key)
            && !found.unknown.contains(keys::folder(&it.key))
            && !may_be_committed(&it.key, references)
    });
    let mut orphans: Vec<Listed> = orphans.collect();
    orphans.sort_by(|a, b| a.key.cmp(&b.key));
    orphans
}

/// Whether a row may name the object later: it was written under a lease that lasts, or by the newest writer of an upload.
fn may_be_committed(key: &str, references: &References) -> bool {
    let owner = keys::collected_folder(key).and_then(FolderOwner::parse);
    match owner {
        Some(FolderOwner::Upload { capture }) => {
            let newest = references.writers.get(capture);
            keys::writer_of_part(key).is_some_and(|(writer, _)| newest == Some(&writer))
        }
        Some(owner) => owner.lease().is_some_and(|lease| {
            let lease = (lease.job.to_owned(), lease.token);
            references.leases.contains(&lease)
        }),
        None => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_may_be_committed_is_no_orphan() {
        let mut references = References::default();
        references.leases.insert(("j".to_owned(), 7));
        references.writers.insert("c".to_owned(), 3);
        let mut found = Verification::default();
        found.keys.insert(keys::render("done", 1, "0.png"));
        found.unknown.insert("models/m/t-1/000000005".to_owned());
        let listed = [
            keys::render("done", 1, "0.png"),
            keys::render("done", 1, "1.png"),
            keys::render("j", 7, "0.png"),
            keys::render("j", 6, "0.png"),
            keys::upload_part("c", 3, 1),
            keys::upload_part("c", 2, 9),
            keys::upload_part("d", 1, 1),
            "models/m/t-1/000000005/weights".to_owned(),
            "models/x".to_owned(),
        ];
        let listed = listed.map(|key| Listed { key, bytes: 1 });
        let orphans = among(listed.into(), &references, &found);
        let orphans: Vec<&str> = orphans.iter().map(|it| it.key.as_str()).collect();
        let expected = [
            "models/x",
            "renders/done/1/1.png",
            "renders/j/6/0.png",
            "uploads/c/parts/2-9",
            "uploads/d/parts/1-1",
        ];
        assert_eq!(orphans, expected);
    }
}
