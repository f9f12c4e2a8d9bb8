-- F1 and area error by value of a parameter: evaluations that differ in it, and seeds, alone
with last as (
  -- the last of each parameter set and seed; a set nobody named is one run's
  select id as run, building, storey, seed, coalesce(nullif(parameters, ''), id) as parameter_set,
         case when variant = 'initial' or suffix(variant, '.initial') then 'initial' else 'final'
           end as plan
  from runs
  where verb = 'evaluate' and state in ('completed', 'partial')
  qualify row_number() over (
    partition by building, storey, plan, seed, parameter_set order by started_at desc, id desc
  ) = 1
),
leaves as (
  select s.parameter_set, p.name, p.value, hash(p.name, p.value) as leaf
  from (select parameter_set, any_value(run) as run from last group by parameter_set) s
  join parameters p on p.run = s.run
  where p.name != 'seed' and not suffix(p.name, '.seed')
),
-- sets that differ in one parameter alone have the same sum over all others
compared as (
  select parameter_set, name, value,
         sum(leaf) over (partition by parameter_set) - leaf as others
  from leaves
),
varied as (
  select c.*
  from compared c
  join (select name, others from compared group by all having count(distinct value) > 1)
    using (name, others)
),
scored as (
  select d.building, d.storey, d.scan, l.plan, l.parameter_set, d.run, d.class, d.metric,
         d.threshold,
         2 * count(*) filter (d.true_id is not null and d.found_id is not null)
           / (count(d.true_id) + count(d.found_id)) as f,
         avg(abs(d.true_m2 - d.found_m2)) as error_m2
  from detections_all d
  join last l on l.run = d.run and l.building = d.building and l.storey = d.storey
  where l.parameter_set in (select parameter_set from varied)
  group by all
)
select building, storey, scan, plan, name as parameter, value,
       -- rows of one parameter are to be compared where this is the same
       left(md5(cast(others as varchar)), 6) as others,
       class, metric, threshold,
       count(*) as runs,
       round(avg(f), 4) as f1,
       round(confidence95(f), 4) as f1_pm,
       round(avg(error_m2), 4) as mean_error_m2,
       round(confidence95(error_m2), 4) as mean_error_pm_m2
from scored
join varied using (parameter_set)
group by building, storey, scan, plan, name, value, varied.others, class, metric, threshold
qualify count(*) over (
  partition by building, storey, scan, plan, name, varied.others, class, metric, threshold
) > 1
order by building, storey, scan nulls first, plan, parameter, others, class, metric, threshold,
         try_cast(value as double), value
