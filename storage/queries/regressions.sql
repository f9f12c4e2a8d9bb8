-- what got worse from one run to the next: each storey, variant and seed's last two, worst first
with ended as (
  select id as run, building, storey, variant, seed, started_at, verb = 'evaluate' as evaluation
  from runs
  where state in ('completed', 'partial')
),
ranked as (
  select *, row_number() over (
    partition by building, storey, variant, seed order by started_at desc, run desc
  ) as back
  from ended
  where evaluation
  qualify back <= 2 and count(*) over (partition by building, storey, variant, seed) > 1
),
counted as (
  select e.building, e.storey, e.variant, e.seed, e.run, e.back, d.scan,
         concat_ws(' ', d.class, d.metric, d.threshold) as what,
         count(d.true_id) as n_true,
         count(d.found_id) as n_found,
         count(*) filter (d.true_id is not null and d.found_id is not null) as n_matched,
         avg(abs(d.true_m2 - d.found_m2)) filter (d.threshold = 0) as mean_error_m2,
         max(abs(d.true_m2 - d.found_m2)) filter (d.threshold = 0) as worst_error_m2
  from detections_all d
  join ranked e on e.run = d.run and e.building = d.building and e.storey = d.storey
  group by all
),
walled as (
  select e.building, e.storey, e.variant, e.seed, e.run, e.back, w.scan,
         'walls ' || w.buffer_m || ' m' as what, w.completeness, w.correctness, w.accuracy_m
  from wall_quality_all w
  join ranked e on e.run = w.run and e.building = w.building and e.storey = w.storey
),
timed as (
  -- a stage taken from the cache took no time: the last two runs that computed it
  select e.building, e.storey, e.variant, e.seed, e.run, s.stage as what, sum(s.wall_s) as seconds,
         row_number() over (
           partition by e.building, e.storey, e.variant, e.seed, s.stage
           order by e.started_at desc, e.run desc
         ) as back
  from stages s
  join ended e on e.run = s.run and e.building = s.building and e.storey = s.storey
  where s.outcome = 'computed'
  group by e.building, e.storey, e.variant, e.seed, e.run, e.started_at, s.stage
),
measured(building, storey, scan, variant, seed, run, back, measure, what, value, better) as (
  select building, storey, scan, variant, seed, run, back, 'recall', what,
         n_matched / nullif(n_true, 0), 1
  from counted
  union all
  select building, storey, scan, variant, seed, run, back, 'precision', what,
         n_matched / nullif(n_found, 0), 1
  from counted
  union all
  select building, storey, scan, variant, seed, run, back, 'f1', what,
         2 * n_matched / (n_found + n_true), 1
  from counted
  union all
  select building, storey, scan, variant, seed, run, back, 'mean_error_m2', 'room area',
         mean_error_m2, -1
  from counted where mean_error_m2 is not null
  union all
  select building, storey, scan, variant, seed, run, back, 'worst_error_m2', 'room area',
         worst_error_m2, -1
  from counted where worst_error_m2 is not null
  union all
  select building, storey, scan, variant, seed, run, back, 'completeness', what, completeness, 1
  from walled
  union all
  select building, storey, scan, variant, seed, run, back, 'correctness', what, correctness, 1
  from walled
  union all
  select building, storey, scan, variant, seed, run, back, 'accuracy_m', what, accuracy_m, -1
  from walled
  union all
  select building, storey, null, variant, seed, run, back, 'seconds', what, seconds, -1
  from timed where back <= 2
),
paired as (
  select building, storey, scan, variant, seed, measure, what, better,
         any_value(run) filter (back = 2) as run_before,
         any_value(run) filter (back = 1) as run_after,
         any_value(value) filter (back = 2) as before,
         any_value(value) filter (back = 1) as after
  from measured
  group by building, storey, scan, variant, seed, measure, what, better
  having before is not null and after is not null
)
select building, storey, scan, variant, measure, what,
       count(*) as seeds,
       round(avg(before), 4) as before,
       round(avg(after), 4) as after,
       round(avg(after) - avg(before), 4) as difference,
       -- of the greater of the two: 1 is all that was there, below 0 it got better
       round(any_value(better) * (avg(paired.before) - avg(paired.after))
         / nullif(greatest(avg(paired.before), avg(paired.after)), 0), 4) as worse,
       max(run_before) as run_before,
       max(run_after) as run_after
from paired
group by building, storey, scan, variant, measure, what
order by worse desc nulls last, building, storey, scan nulls first, variant, measure, what
