-- hits per run: how much of each run came from the cache
select r.started_at, r.building, r.storey, r.id as run, r.state,
       count(s.id) as stages,
       count(*) filter (s.outcome = 'cached') as cached,
       count(*) filter (s.outcome = 'computed') as computed,
       count(*) filter (s.outcome = 'failed') as failed,
       round(100.0 * count(*) filter (s.outcome = 'cached') / nullif(count(s.id), 0), 1)
         as cached_percent
from runs r
left join stages s on s.run = r.id
group by all
order by r.started_at desc, r.id
