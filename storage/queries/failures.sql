-- what failed and why, last first: stages, and runs that ended badly
select started_at, building, storey, scan, stage, error, run
from stages
where outcome = 'failed'
union all by name
select started_at, building, storey, null as scan, '(run)' as stage, message as error, id as run
from runs
where state in ('failed', 'partial')
order by started_at desc, stage
