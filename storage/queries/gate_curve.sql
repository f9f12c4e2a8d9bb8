-- the quality gate over T_q: scans accepted, and how good a judge of what is usable it is
with thresholds as (select unnest(range(0, 21)) / 20.0 as t_q),
judged as (
  select q.building, q.storey, q.p_sum, w.usable, e.error_m2, e.iou
  -- once, however many variants and seeds read it
  from (select distinct * exclude (run, variant, seed, parameters) from quality) q
  left join (select distinct * exclude (run, variant, seed, parameters) from scan_work) w
    on w.building = q.building and w.storey = q.storey and w.scan = q.scan
  left join (select distinct * exclude (run, variant, seed, parameters) from room_errors) e
    on e.building = q.building and e.storey = q.storey and e.scan = q.scan
  where q.p_sum is not null
)
select building, storey, t_q,
       count(*) as assessed,
       count(*) filter (p_sum <= t_q) as accepted,
       round(100.0 * count(*) filter (p_sum <= t_q) / count(*), 1) as accepted_percent,
       -- null where none was rejected, or nobody said what was usable
       round(100.0 * count(*) filter (p_sum > t_q and not usable)
         / nullif(count(usable) filter (p_sum > t_q), 0), 1) as unusable_of_rejected_percent,
       round(100.0 * count(*) filter (p_sum <= t_q and not usable)
         / nullif(count(usable) filter (p_sum <= t_q), 0), 1) as unusable_of_accepted_percent,
       round(100.0 * count(*) filter (p_sum > t_q and not usable)
         / nullif(count(*) filter (not usable), 0), 1) as unusable_caught_percent,
       -- of the room each scan alone makes, against the truth
       round(median(error_m2) filter (p_sum <= t_q), 3) as accepted_error_m2,
       round(median(error_m2) filter (p_sum > t_q), 3) as rejected_error_m2,
       round(avg(iou) filter (p_sum <= t_q), 3) as accepted_iou,
       round(avg(iou) filter (p_sum > t_q), 3) as rejected_iou
from thresholds, judged
group by building, storey, t_q
order by building, storey, t_q
