//! Several lists of jobs at once.

use crate::db::{Tx, sql};
use crate::scripts::jobs::{narrow, place, read, select_jobs};
use crate::{JobGroup, StoreError, Tenant};
use yoto_proto::v1::Job;

/// The newest jobs of each group. QUEUED jobs have their positions in the queue where the group asks for them.
pub(crate) async fn groups(
    tx: &mut Tx,
    tenant: &Tenant,
    groups: &[JobGroup],
) -> Result<Vec<Vec<Job>>, StoreError> {
    let mut found = vec![Vec::new(); groups.len()];
    if groups.is_empty() {
        return Ok(found);
    }
    let mut query = sql("").bind(tenant.id());
    for (number, group) in groups.iter().enumerate() {
        query.push(if number == 0 { "" } else { " UNION ALL " });
        query.push(&format!(
            "SELECT * FROM (SELECT CAST({number} AS BIGINT) AS place, n.* FROM ("
        ));
        // The order is left out, and its column is there, since all parts have the same ones.
        query.push(match group.full {
            true => select_jobs!(", j.spec AS orders", "WHERE j.tenant = $1"),
            false => select_jobs!(
                ", CASE WHEN 1 = 0 THEN j.spec END AS orders",
                "WHERE j.tenant = $1"
            ),
        });
        narrow(&mut query, &group.filter);
        if let Some(ids) = &group.ids {
            // No job has the id NULL: a list may be empty.
            query.push(" AND j.id IN (NULL");
            for id in ids {
                query.push(", ");
                query.push_bind(id);
            }
            query.push(")");
        }
        query.push(" ORDER BY j.ord DESC LIMIT ");
        query.push_bind(group.most);
        query.push(&format!(") AS n) AS group_{number}"));
    }
    query.push(" ORDER BY place, ord DESC");
    let rows = query.rows(tx, "listing the jobs of a page").await?;
    let mut jobs = Vec::with_capacity(rows.len());
    for row in &rows {
        let mut job = read(row)?;
        job.spec = row.message("orders")?;
        jobs.push((row.number::<usize>("place")?, job));
    }
    let shown = |number: &usize| groups.get(*number).is_some_and(|it| it.positions);
    let placed = rows.iter().zip(&mut jobs);
    let placed = placed.filter(|(_, (number, _))| shown(number));
    place(tx, tenant, placed.map(|(row, (_, job))| (row, job))).await?;
    for (number, job) in jobs {
        if let Some(group) = found.get_mut(number) {
            group.push(job);
        }
    }
    Ok(found)
}
