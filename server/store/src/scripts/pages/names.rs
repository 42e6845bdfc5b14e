//! Names for people of resources.

use crate::db::{Tx, sql};
use crate::{StoreError, Tenant};
use std::collections::HashMap;
use yoto_proto::names::Collection;

/// Where the name of a resource of a collection is.
const SOURCES: [(Collection, &str); 3] = [
    (
        Collection::Models,
        "SELECT 'models' AS collection, m.id, m.display_name FROM models m WHERE m.tenant = $1 AND m.id IN (",
    ),
    (
        Collection::Subjects,
        "SELECT 'subjects' AS collection, s.id, s.display_name FROM subjects s WHERE s.tenant = $1 AND s.id IN (",
    ),
    (
        Collection::Captures,
        "SELECT 'captures' AS collection, c.id, s.display_name FROM captures c JOIN subjects s ON s.id = c.subject
         WHERE s.tenant = $1 AND c.id IN (",
    ),
];

/// The names of those of `resources` that the tenant has, by resource: of a model, of a person, and of the person of a capture.
/// Other resources have none.
pub(crate) async fn of(
    tx: &mut Tx,
    tenant: &Tenant,
    resources: &[&str],
) -> Result<HashMap<String, String>, StoreError> {
    let mut query = sql("").bind(tenant.id());
    let mut any = false;
    for (collection, source) in SOURCES {
        let ids = resources.iter().filter_map(|it| collection.parse(it).ok());
        let ids: Vec<&str> = ids.collect();
        if ids.is_empty() {
            continue;
        }
        query.push(if any { " UNION ALL " } else { "" });
        query.push(source);
        query.push_all(ids);
        query.push(")");
        any = true;
    }
    let mut names = HashMap::new();
    if !any {
        return Ok(names);
    }
    for row in query.rows(tx, "reading names").await? {
        let resource = format!("{}/{}", row.text("collection")?, row.text("id")?);
        names.insert(resource, row.text("display_name")?);
    }
    Ok(names)
}
